#include "render/context.h"

#include <epoxy/egl.h>
#include <epoxy/gl.h>
#include <errno.h>
#include <stdlib.h>
#include <string.h>

#define MAX_DEVICES 16

struct gl_context {
    EGLDisplay display;
    EGLContext context;
};

static bool has_extension(const char *list, const char *name)
{
    size_t length = strlen(name);
    for (const char *at = list; at && (at = strstr(at, name)); at += length)
        if ((at == list || at[-1] == ' ') && (at[length] == ' ' || at[length] == '\0'))
            return true;
    return false;
}

/* A core context of 4.5 that tells when it is lost, where the driver can. */
static EGLContext make_context(EGLDisplay display, EGLConfig config)
{
    EGLint attributes[] = {EGL_CONTEXT_MAJOR_VERSION,
                           4,
                           EGL_CONTEXT_MINOR_VERSION,
                           5,
                           EGL_CONTEXT_OPENGL_PROFILE_MASK,
                           EGL_CONTEXT_OPENGL_CORE_PROFILE_BIT,
                           EGL_CONTEXT_OPENGL_RESET_NOTIFICATION_STRATEGY,
                           EGL_LOSE_CONTEXT_ON_RESET,
                           EGL_NONE};
    EGLContext made = eglCreateContext(display, config, EGL_NO_CONTEXT, attributes);
    attributes[6] = EGL_NONE;
    return made != EGL_NO_CONTEXT ? made
                                  : eglCreateContext(display, config, EGL_NO_CONTEXT, attributes);
}

static bool make_current(EGLDisplay display, EGLContext context)
{
    return context != EGL_NO_CONTEXT &&
           eglMakeCurrent(display, EGL_NO_SURFACE, EGL_NO_SURFACE, context);
}

/* Says what there is where 4.5 is not. */
static void note_offer(EGLDisplay display, EGLConfig config, struct diag *diag)
{
    EGLContext context = eglCreateContext(display, config, EGL_NO_CONTEXT, NULL);
    if (make_current(display, context))
        diag_set(diag, -ENODEV, "OpenGL 4.5 core is needed; %s offers OpenGL %s",
                 (const char *)glGetString(GL_RENDERER), (const char *)glGetString(GL_VERSION));
    eglMakeCurrent(display, EGL_NO_SURFACE, EGL_NO_SURFACE, EGL_NO_CONTEXT);
    if (context != EGL_NO_CONTEXT)
        eglDestroyContext(display, context);
}

/* Makes a context on one display; false where it cannot be done. */
static bool try_display(EGLDisplay display, struct gl_context *context, struct diag *diag)
{
    EGLint major, minor;
    if (display == EGL_NO_DISPLAY || !eglInitialize(display, &major, &minor))
        return false;
    const EGLint config_attributes[] = {EGL_SURFACE_TYPE, EGL_PBUFFER_BIT, EGL_RENDERABLE_TYPE,
                                        EGL_OPENGL_BIT, EGL_NONE};
    EGLConfig config = EGL_NO_CONFIG_KHR;
    EGLint count = 0;
    if (!eglChooseConfig(display, config_attributes, &config, 1, &count) || count == 0)
        config = EGL_NO_CONFIG_KHR;
    if (eglBindAPI(EGL_OPENGL_API)) {
        EGLContext made = make_context(display, config);
        if (make_current(display, made)) {
            *context = (struct gl_context){.display = display, .context = made};
            return true;
        }
        if (made != EGL_NO_CONTEXT)
            eglDestroyContext(display, made);
        note_offer(display, config, diag);
    }
    eglTerminate(display);
    return false;
}

static bool try_devices(const char *client_extensions, struct gl_context *context,
                        struct diag *diag)
{
    if (!has_extension(client_extensions, "EGL_EXT_platform_device") ||
        !has_extension(client_extensions, "EGL_EXT_device_enumeration"))
        return false;
    EGLDeviceEXT devices[MAX_DEVICES];
    EGLint count = 0;
    if (!eglQueryDevicesEXT(MAX_DEVICES, devices, &count))
        return false;
    for (EGLint i = 0; i < count; i++) {
        const char *extensions = eglQueryDeviceStringEXT(devices[i], EGL_EXTENSIONS);
        if (has_extension(extensions, "EGL_MESA_device_software"))
            continue;
        EGLDisplay display = eglGetPlatformDisplayEXT(EGL_PLATFORM_DEVICE_EXT, devices[i], NULL);
        if (try_display(display, context, diag))
            return true;
    }
    return false;
}

static bool try_surfaceless(const char *client_extensions, struct gl_context *context,
                            struct diag *diag)
{
    if (!has_extension(client_extensions, "EGL_MESA_platform_surfaceless"))
        return false;
    return try_display(
        eglGetPlatformDisplayEXT(EGL_PLATFORM_SURFACELESS_MESA, EGL_DEFAULT_DISPLAY, NULL), context,
        diag);
}

int gl_context_create_headless(struct gl_context **ret_context, struct diag *diag)
{
    struct gl_context *context = calloc(1, sizeof(*context));
    if (!context)
        return diag_set(diag, -ENOMEM, "no memory for a GL context");
    const char *extensions = eglQueryString(EGL_NO_DISPLAY, EGL_EXTENSIONS);
    diag_set(diag, -ENODEV,
             "no EGL device or surfaceless platform gives OpenGL 4.5 core (is a driver installed: "
             "libegl-mesa0 with libgl1-mesa-dri, or the GPU vendor's?)");
    if (!try_devices(extensions, context, diag) && !try_surfaceless(extensions, context, diag)) {
        free(context);
        return -ENODEV;
    }
    *ret_context = context;
    return 0;
}

void gl_context_destroy(struct gl_context *context)
{
    if (!context)
        return;
    eglMakeCurrent(context->display, EGL_NO_SURFACE, EGL_NO_SURFACE, EGL_NO_CONTEXT);
    eglDestroyContext(context->display, context->context);
    eglTerminate(context->display);
    free(context);
}
