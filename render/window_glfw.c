#include "render/window.h"

#include <epoxy/gl.h>
#define GLFW_INCLUDE_NONE
#include <errno.h>
#include <GLFW/glfw3.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

struct window {
    GLFWwindow *glfw;
    int width, height; /* of the frames */
    /* Of what is seen of them, 0 while the window is minimised. Written by the main thread. */
    _Atomic int shown_width, shown_height;
    atomic_bool minimised;
};

static char last_error[256];

static void keep_error(int code, const char *text)
{
    snprintf(last_error, sizeof(last_error), "%s (GLFW %#x)", text, (unsigned)code);
}

static void on_size(GLFWwindow *glfw, int width, int height)
{
    struct window *window = glfwGetWindowUserPointer(glfw);
    atomic_store(&window->shown_width, width);
    atomic_store(&window->shown_height, height);
}

static void on_minimise(GLFWwindow *glfw, int minimised)
{
    struct window *window = glfwGetWindowUserPointer(glfw);
    atomic_store(&window->minimised, minimised);
}

/* So that the thread that draws need not ask, which belongs to the main thread. */
static void watch_size(struct window *window)
{
    int width, height;
    glfwSetWindowUserPointer(window->glfw, window);
    glfwSetFramebufferSizeCallback(window->glfw, on_size);
    glfwSetWindowIconifyCallback(window->glfw, on_minimise);
    glfwGetFramebufferSize(window->glfw, &width, &height);
    on_size(window->glfw, width, height);
}

static int find_monitor(const struct window_params *params, GLFWmonitor **ret_monitor,
                        struct diag *diag)
{
    *ret_monitor = NULL;
    if (!params->fullscreen)
        return 0;
    if (params->monitor[0] == '\0') {
        *ret_monitor = glfwGetPrimaryMonitor();
        return *ret_monitor ? 0 : diag_set(diag, -ENODEV, "no monitor is connected");
    }
    int count = 0;
    GLFWmonitor **monitors = glfwGetMonitors(&count);
    for (int i = 0; i < count; i++)
        if (strcmp(glfwGetMonitorName(monitors[i]), params->monitor) == 0)
            *ret_monitor = monitors[i];
    return *ret_monitor ? 0
                        : diag_set(diag, -ENODEV, "no monitor is named \"%s\"", params->monitor);
}

int window_create(const struct window_params *params, struct window **ret_window, struct diag *diag)
{
    glfwSetErrorCallback(keep_error);
    if (!glfwInit())
        return diag_set(diag, -ENODEV, "no display: %s", last_error);
    GLFWmonitor *monitor;
    int r = find_monitor(params, &monitor, diag);
    struct window *window = calloc(1, sizeof(*window));
    if (r == 0 && !window)
        r = diag_set(diag, -ENOMEM, "no memory for a window");
    if (r == 0) {
        glfwWindowHint(GLFW_CONTEXT_VERSION_MAJOR, 4);
        glfwWindowHint(GLFW_CONTEXT_VERSION_MINOR, 5);
        glfwWindowHint(GLFW_OPENGL_PROFILE, GLFW_OPENGL_CORE_PROFILE);
        glfwWindowHint(GLFW_CONTEXT_ROBUSTNESS, GLFW_LOSE_CONTEXT_ON_RESET);
        glfwWindowHint(GLFW_RESIZABLE, GLFW_FALSE);
        glfwWindowHint(GLFW_DEPTH_BITS, 0);
        glfwWindowHint(GLFW_STENCIL_BITS, 0);
        window->width = params->width;
        window->height = params->height;
        window->glfw =
            glfwCreateWindow(params->width, params->height, params->title, monitor, NULL);
        if (!window->glfw)
            r = diag_set(diag, -ENODEV, "no window with OpenGL 4.5: %s", last_error);
    }
    if (r < 0) {
        free(window);
        glfwTerminate();
        return r;
    }
    watch_size(window);
    *ret_window = window;
    return 0;
}

void window_destroy(struct window *window)
{
    if (!window)
        return;
    glfwDestroyWindow(window->glfw);
    glfwTerminate();
    free(window);
}

void window_make_current(struct window *window)
{
    glfwMakeContextCurrent(window->glfw);
    glfwSwapInterval(1);
}

void window_release(struct window *window)
{
    if (window)
        glfwMakeContextCurrent(NULL);
}

void window_show(struct window *window, unsigned framebuffer)
{
    int width = atomic_load(&window->shown_width), height = atomic_load(&window->shown_height);
    if (width <= 0 || height <= 0 || atomic_load(&window->minimised))
        return;
    bool same = width == window->width && height == window->height;
    glBlitNamedFramebuffer(framebuffer, 0, 0, 0, window->width, window->height, 0, 0, width, height,
                           GL_COLOR_BUFFER_BIT, same ? GL_NEAREST : GL_LINEAR);
    glfwSwapBuffers(window->glfw);
}

bool window_poll(struct window *window)
{
    glfwPollEvents();
    return glfwWindowShouldClose(window->glfw);
}
