/* Lets calls fail. To be preloaded (LD_PRELOAD) into the program, after the model of SQLite's tests
 * of malloc() and of I/O errors.
 *
 * FAIL_CLASS is the class of calls that is counted: memory, file, socket or gl for those of the
 * program's own code, sqlite-memory or sqlite-file for those of SQLite. What other libraries do for
 * themselves is theirs: glibc, Mesa and systemd are not ours to mend.
 * FAIL_SITE (hexadecimal; optional) counts only the calls that return to that place of the
 * program, whichever thread is first; FAIL_NAME (optional) only those of the function of that name.
 * FAIL_AT is the number of the call that fails, from 1 on, 0 for none; where FAIL_ONWARD is set
 * those after it fail, too. FAIL_AFTER_S: calls count from then on. FAIL_WHILE: calls count while
 * there is a file of that name; what stands in it takes the place of FAIL_SITE. FAIL_LIST is a file
 * that receives at exit, or when the program is stopped in order, a line "site calls" for each
 * place that asked. FAIL_DONE is a file that is there once a call has failed.
 */
#include <dlfcn.h>
#include <epoxy/egl.h>
#include <epoxy/gl.h>
#include <errno.h>
#include <fcntl.h>
#include <link.h>
#include <stdarg.h>
#include <stdatomic.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#define EXPORT    __attribute__((visibility("default")))
#define SITES_MAX 2048

enum class { MEMORY, FILES, SOCKET, GL, CLASSES };

static const char *const class_names[CLASSES] = {"memory", "file", "socket", "gl"};

struct text {
    uintptr_t base, start, end;
};

static struct {
    struct text program, sqlite, counted; /* `counted` is one of the others */
    int class;                            /* CLASSES: none */
    uintptr_t site;                       /* 0: any */
    const char *name;                     /* NULL: any */
    unsigned long at;
    bool onward;
    const char *done;
    double after_s;
    const char *during;
    atomic_ulong calls;
    atomic_bool has_failed;
    struct {
        _Atomic uintptr_t site;
        atomic_ulong calls;
    } sites[SITES_MAX];
    _Atomic GLenum gl_error; /* not yet told */
} state = {.class = CLASSES};

static int find_text(struct dl_phdr_info *info, size_t size, void *data)
{
    bool program = !info->dlpi_name[0] && !state.program.end;
    struct text *text = program ? &state.program : &state.sqlite;
    if (!program && !strstr(info->dlpi_name, "libsqlite3"))
        return 0;
    text->base = info->dlpi_addr;
    for (int i = 0; i < info->dlpi_phnum; i++) {
        const ElfW(Phdr) *header = &info->dlpi_phdr[i];
        if (header->p_type == PT_LOAD && (header->p_flags & PF_X)) {
            text->start = info->dlpi_addr + header->p_vaddr;
            text->end = text->start + header->p_memsz;
        }
    }
    return 0;
}

static double now_s(void)
{
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

static void note_site(uintptr_t site)
{
    for (unsigned i = 0; i < SITES_MAX; i++) {
        uintptr_t free_entry = 0;
        if (atomic_load(&state.sites[i].site) != site &&
            !atomic_compare_exchange_strong(&state.sites[i].site, &free_entry, site) &&
            free_entry != site)
            continue;
        atomic_fetch_add(&state.sites[i].calls, 1);
        return;
    }
}

/* Once, or once again after somebody has removed it where places take turns. */
static void touch_done(void)
{
    bool before = atomic_exchange(&state.has_failed, true);
    if (!state.done || (before && (!state.during || access(state.done, F_OK) == 0)))
        return;
    FILE *out = fopen(state.done, "w");
    if (out)
        fclose(out);
}

/* False where there is no file: else its text, a site, in place of `site`. */
static bool read_during(uintptr_t *site)
{
    char text[32] = "";
    int fd = open(state.during, O_RDONLY | O_CLOEXEC);
    if (fd < 0)
        return false;
    ssize_t size = read(fd, text, sizeof(text) - 1);
    close(fd);
    if (size > 1)
        *site = strtoul(text, NULL, 16);
    return true;
}

static bool fails(enum class class, const char *name, const void *return_address)
{
    uintptr_t caller = (uintptr_t)return_address;
    if ((int)class != state.class || caller < state.counted.start || caller >= state.counted.end)
        return false;
    if (state.name && state.name[0] && strcmp(name, state.name) != 0)
        return false;
    uintptr_t site = caller - state.counted.base, wanted = state.site;
    if (state.after_s > 0.0 && now_s() < state.after_s)
        return false;
    if (state.during && !read_during(&wanted))
        return false;
    note_site(site);
    if (wanted && site != wanted)
        return false;
    unsigned long call = atomic_fetch_add(&state.calls, 1) + 1;
    if (state.at == 0 || call < state.at || (call > state.at && !state.onward))
        return false;
    touch_done();
    return true;
}

#define HERE __builtin_return_address(0)

/* A function of a library under its own name. The errno of the failure, what it returns then. */
#define FAILING(class, type, name, error, result, parameters, arguments)                           \
    EXPORT type fail_##name parameters __asm__(#name);                                             \
    EXPORT type fail_##name parameters                                                             \
    {                                                                                              \
        static type(*next) parameters;                                                             \
        if (!next)                                                                                 \
            next = (type(*) parameters)dlsym(RTLD_NEXT, #name);                                    \
        if (fails(class, #name, HERE)) {                                                           \
            errno = error;                                                                         \
            return result;                                                                         \
        }                                                                                          \
        return next arguments;                                                                     \
    }

FAILING(MEMORY, void *, malloc, ENOMEM, NULL, (size_t size), (size))
FAILING(MEMORY, void *, calloc, ENOMEM, NULL, (size_t count, size_t size), (count, size))
FAILING(MEMORY, void *, realloc, ENOMEM, NULL, (void *memory, size_t size), (memory, size))
FAILING(MEMORY, void *, reallocarray, ENOMEM, NULL, (void *memory, size_t count, size_t size),
        (memory, count, size))
FAILING(MEMORY, void *, aligned_alloc, ENOMEM, NULL, (size_t alignment, size_t size),
        (alignment, size))
FAILING(MEMORY, char *, strdup, ENOMEM, NULL, (const char *text), (text))
FAILING(MEMORY, int, vasprintf, ENOMEM, -1, (char **text, const char *format, va_list list),
        (text, format, list))
EXPORT int fail_asprintf(char **text, const char *format, ...) __asm__("asprintf");
EXPORT int fail_asprintf(char **text, const char *format, ...)
{
    va_list list;
    if (fails(MEMORY, "asprintf", HERE)) {
        errno = ENOMEM;
        return -1;
    }
    va_start(list, format);
    int length = vsnprintf(NULL, 0, format, list);
    va_end(list);
    *text = length < 0 ? NULL : calloc(1, (size_t)length + 1);
    if (!*text)
        return -1;
    va_start(list, format);
    vsnprintf(*text, (size_t)length + 1, format, list);
    va_end(list);
    return length;
}
FAILING(MEMORY, void *, mmap64, ENOMEM, (void *)-1,
        (void *at, size_t size, int prot, int flags, int fd, long offset),
        (at, size, prot, flags, fd, offset))
FAILING(MEMORY, int, pthread_create, EAGAIN, EAGAIN,
        (void *thread, const void *attributes, void *(*start)(void *), void *data),
        (thread, attributes, start, data))

FAILING(FILES, int, open64, EMFILE, -1, (const char *path, int flags, int mode),
        (path, flags, mode))
FAILING(FILES, void *, fopen64, EMFILE, NULL, (const char *path, const char *mode), (path, mode))
FAILING(FILES, void *, opendir, EMFILE, NULL, (const char *path), (path))
FAILING(FILES, long, read, EIO, -1, (int fd, void *bytes, size_t size), (fd, bytes, size))
FAILING(FILES, long, write, ENOSPC, -1, (int fd, const void *bytes, size_t size), (fd, bytes, size))
FAILING(FILES, long, pread64, EIO, -1, (int fd, void *bytes, size_t size, long offset),
        (fd, bytes, size, offset))
FAILING(FILES, long, pwrite64, ENOSPC, -1, (int fd, const void *bytes, size_t size, long offset),
        (fd, bytes, size, offset))
FAILING(FILES, size_t, fread, EIO, 0, (void *bytes, size_t size, size_t count, void *file),
        (bytes, size, count, file))
FAILING(FILES, size_t, fwrite, ENOSPC, 0,
        (const void *bytes, size_t size, size_t count, void *file), (bytes, size, count, file))
FAILING(FILES, char *, fgets, EIO, NULL, (char *text, int size, void *file), (text, size, file))
FAILING(FILES, int, mkstemp64, EACCES, -1, (char *path), (path))
FAILING(FILES, int, fflush, ENOSPC, -1, (void *file), (file))
FAILING(FILES, int, fsync, EIO, -1, (int fd), (fd))
FAILING(FILES, int, fdatasync, EIO, -1, (int fd), (fd))
FAILING(FILES, int, ftruncate64, EIO, -1, (int fd, long size), (fd, size))
FAILING(FILES, int, rename, EIO, -1, (const char *from, const char *to), (from, to))
FAILING(FILES, int, unlink, EIO, -1, (const char *path), (path))
FAILING(FILES, int, mkdir, EACCES, -1, (const char *path, unsigned mode), (path, mode))
FAILING(FILES, int, fstat64, EIO, -1, (int fd, void *stat), (fd, stat))
FAILING(FILES, int, stat64, EIO, -1, (const char *path, void *stat), (path, stat))
FAILING(FILES, int, flock, ENOLCK, -1, (int fd, int operation), (fd, operation))

FAILING(SOCKET, int, socket, EMFILE, -1, (int domain, int type, int protocol),
        (domain, type, protocol))
FAILING(SOCKET, int, bind, EADDRINUSE, -1, (int fd, const void *address, unsigned size),
        (fd, address, size))
FAILING(SOCKET, int, connect, ENETUNREACH, -1, (int fd, const void *address, unsigned size),
        (fd, address, size))
FAILING(SOCKET, int, listen, EADDRINUSE, -1, (int fd, int backlog), (fd, backlog))
FAILING(SOCKET, int, accept4, EMFILE, -1, (int fd, void *address, unsigned *size, int flags),
        (fd, address, size, flags))
FAILING(SOCKET, int, setsockopt, ENOMEM, -1,
        (int fd, int level, int name, const void *value, unsigned size),
        (fd, level, name, value, size))
FAILING(SOCKET, int, getsockname, ENOBUFS, -1, (int fd, void *address, unsigned *size),
        (fd, address, size))
FAILING(SOCKET, long, recvmsg, ENOMEM, -1, (int fd, void *message, int flags), (fd, message, flags))
FAILING(SOCKET, long, recv, ENOMEM, -1, (int fd, void *bytes, size_t size, int flags),
        (fd, bytes, size, flags))
FAILING(SOCKET, long, send, ENOBUFS, -1, (int fd, const void *bytes, size_t size, int flags),
        (fd, bytes, size, flags))
FAILING(SOCKET, long, sendto, ENOBUFS, -1,
        (int fd, const void *bytes, size_t size, int flags, const void *to, unsigned to_size),
        (fd, bytes, size, flags, to, to_size))
FAILING(SOCKET, int, getaddrinfo, ENOMEM, -10, /* EAI_MEMORY */
        (const char *host, const char *port, const void *hints, void **ret_list),
        (host, port, hints, ret_list))
FAILING(SOCKET, int, epoll_create1, EMFILE, -1, (int flags), (flags))
FAILING(SOCKET, int, epoll_ctl, ENOMEM, -1, (int fd, int operation, int of, void *event),
        (fd, operation, of, event))
FAILING(SOCKET, int, eventfd, EMFILE, -1, (unsigned count, int flags), (count, flags))
FAILING(SOCKET, int, timerfd_create, EMFILE, -1, (int clock, int flags), (clock, flags))
FAILING(SOCKET, int, getsockopt, ENOBUFS, -1,
        (int fd, int level, int name, void *value, unsigned *size), (fd, level, name, value, size))
FAILING(SOCKET, unsigned, if_nametoindex, ENODEV, 0, (const char *name), (name))
FAILING(SOCKET, int, pipe, EMFILE, -1, (int *fds), (fds))
FAILING(SOCKET, int, pipe2, EMFILE, -1, (int *fds, int flags), (fds, flags))
FAILING(SOCKET, int, sd_event_new, ENOMEM, -ENOMEM, (void **ret), (ret))
FAILING(SOCKET, int, sd_event_add_io, ENOMEM, -ENOMEM,
        (void *loop, void **ret, int fd, unsigned events, void *callback, void *data),
        (loop, ret, fd, events, callback, data))
FAILING(SOCKET, int, sd_event_add_time, ENOMEM, -ENOMEM,
        (void *loop, void **ret, int clock, uint64_t usec, uint64_t accuracy, void *callback,
         void *data),
        (loop, ret, clock, usec, accuracy, callback, data))
FAILING(SOCKET, int, sd_event_add_signal, ENOMEM, -ENOMEM,
        (void *loop, void **ret, int number, void *callback, void *data),
        (loop, ret, number, callback, data))

FAILING(SOCKET, int, sd_event_source_set_time, ENOMEM, -ENOMEM, (void *of, uint64_t usec),
        (of, usec))
FAILING(SOCKET, int, sd_event_source_set_time_relative, ENOMEM, -ENOMEM, (void *of, uint64_t usec),
        (of, usec))
FAILING(SOCKET, int, sd_event_source_set_enabled, ENOMEM, -ENOMEM, (void *of, int enabled),
        (of, enabled))

/* libepoxy's entry points are variables, which are set to the driver's at each one's first call.
 * Only the thread that draws calls them. What fails has made nothing, and says that memory has run
 * out. */
#define OUT_OF_MEMORY atomic_store(&state.gl_error, GL_OUT_OF_MEMORY)
#define KEEP_HOOK(entry, hook, next)                                                               \
    if (entry != hook) {                                                                           \
        next = entry;                                                                              \
        entry = hook;                                                                              \
    }
#define FAILING_GL(name, parameters, arguments)                                                    \
    static void(*next_##name) parameters;                                                          \
    static void fail_##name parameters                                                             \
    {                                                                                              \
        if (fails(GL, #name, HERE)) {                                                              \
            OUT_OF_MEMORY;                                                                         \
            return;                                                                                \
        }                                                                                          \
        epoxy_##name = next_##name;                                                                \
        next_##name arguments;                                                                     \
        KEEP_HOOK(epoxy_##name, fail_##name, next_##name)                                          \
    }
#define FAILING_GL_VALUE(type, name, result, parameters, arguments)                                \
    static type(*next_##name) parameters;                                                          \
    static type fail_##name parameters                                                             \
    {                                                                                              \
        if (fails(GL, #name, HERE)) {                                                              \
            OUT_OF_MEMORY;                                                                         \
            return result;                                                                         \
        }                                                                                          \
        epoxy_##name = next_##name;                                                                \
        type value = next_##name arguments;                                                        \
        KEEP_HOOK(epoxy_##name, fail_##name, next_##name)                                          \
        return value;                                                                              \
    }

FAILING_GL(glCreateBuffers, (GLsizei count, GLuint *ret), (count, ret))
FAILING_GL(glCreateFramebuffers, (GLsizei count, GLuint *ret), (count, ret))
FAILING_GL(glCreateRenderbuffers, (GLsizei count, GLuint *ret), (count, ret))
FAILING_GL(glCreateVertexArrays, (GLsizei count, GLuint *ret), (count, ret))
FAILING_GL(glCreateQueries, (GLenum target, GLsizei count, GLuint *ret), (target, count, ret))
FAILING_GL(glCreateTextures, (GLenum target, GLsizei count, GLuint *ret), (target, count, ret))
FAILING_GL(glNamedBufferStorage, (GLuint at, GLsizeiptr size, const void *bytes, GLbitfield flags),
           (at, size, bytes, flags))
FAILING_GL(glNamedRenderbufferStorage, (GLuint at, GLenum format, GLsizei w, GLsizei h),
           (at, format, w, h))
FAILING_GL(glTextureStorage2D, (GLuint at, GLsizei levels, GLenum format, GLsizei w, GLsizei h),
           (at, levels, format, w, h))
FAILING_GL(glTextureStorage3D,
           (GLuint at, GLsizei levels, GLenum format, GLsizei w, GLsizei h, GLsizei d),
           (at, levels, format, w, h, d))
FAILING_GL(glCompileShader, (GLuint shader), (shader))
FAILING_GL(glLinkProgram, (GLuint program), (program))
FAILING_GL_VALUE(GLuint, glCreateProgram, 0, (void), ())
FAILING_GL_VALUE(GLuint, glCreateShader, 0, (GLenum stage), (stage))
FAILING_GL_VALUE(void *, glMapNamedBufferRange, NULL,
                 (GLuint at, GLintptr from, GLsizeiptr size, GLbitfield access),
                 (at, from, size, access))
FAILING_GL_VALUE(EGLBoolean, eglInitialize, EGL_FALSE,
                 (EGLDisplay display, EGLint *major, EGLint *minor), (display, major, minor))
FAILING_GL_VALUE(EGLBoolean, eglMakeCurrent, EGL_FALSE,
                 (EGLDisplay display, EGLSurface draw, EGLSurface read, EGLContext context),
                 (display, draw, read, context))
FAILING_GL_VALUE(EGLContext, eglCreateContext, EGL_NO_CONTEXT,
                 (EGLDisplay display, EGLConfig config, EGLContext share, const EGLint *list),
                 (display, config, share, list))

static GLenum (*next_glGetError)(void);
static GLenum fail_glGetError(void)
{
    epoxy_glGetError = next_glGetError;
    GLenum error = next_glGetError();
    KEEP_HOOK(epoxy_glGetError, fail_glGetError, next_glGetError)
    GLenum ours = atomic_exchange(&state.gl_error, GL_NO_ERROR);
    return ours ? ours : error;
}

#define HOOK(name)                                                                                 \
    next_##name = epoxy_##name;                                                                    \
    epoxy_##name = fail_##name

static void hook_gl(void)
{
    HOOK(glCreateBuffers);
    HOOK(glCreateFramebuffers);
    HOOK(glCreateRenderbuffers);
    HOOK(glCreateVertexArrays);
    HOOK(glCreateQueries);
    HOOK(glCreateTextures);
    HOOK(glNamedBufferStorage);
    HOOK(glNamedRenderbufferStorage);
    HOOK(glTextureStorage2D);
    HOOK(glTextureStorage3D);
    HOOK(glCompileShader);
    HOOK(glLinkProgram);
    HOOK(glCreateProgram);
    HOOK(glCreateShader);
    HOOK(glMapNamedBufferRange);
    HOOK(eglInitialize);
    HOOK(eglMakeCurrent);
    HOOK(eglCreateContext);
    HOOK(glGetError);
}

static unsigned long number_of(const char *name, int base)
{
    const char *text = getenv(name);
    return text ? strtoul(text, NULL, base) : 0;
}

__attribute__((constructor)) static void begin(void)
{
    const char *class = getenv("FAIL_CLASS");
    bool sqlite = class && strncmp(class, "sqlite-", 7) == 0;
    dl_iterate_phdr(find_text, NULL);
    state.counted = sqlite ? state.sqlite : state.program;
    state.site = number_of("FAIL_SITE", 16);
    state.name = getenv("FAIL_NAME");
    state.at = number_of("FAIL_AT", 10);
    state.onward = getenv("FAIL_ONWARD") != NULL;
    state.done = getenv("FAIL_DONE");
    state.after_s = getenv("FAIL_AFTER_S") ? now_s() + atof(getenv("FAIL_AFTER_S")) : 0.0;
    state.during = getenv("FAIL_WHILE");
    hook_gl();
    for (int i = 0; class && i < CLASSES; i++)
        if (strcmp(class + (sqlite ? 7 : 0), class_names[i]) == 0)
            state.class = i;
}

__attribute__((destructor)) static void end(void)
{
    const char *path = getenv("FAIL_LIST");
    FILE *out = path ? fopen(path, "w") : NULL;
    state.class = CLASSES;
    if (!out)
        return;
    for (unsigned i = 0; i < SITES_MAX && state.sites[i].site; i++)
        fprintf(out, "%lx %lu\n", (unsigned long)state.sites[i].site, state.sites[i].calls);
    fclose(out);
}
