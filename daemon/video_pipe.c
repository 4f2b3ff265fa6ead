#include "daemon/video_pipe.h"

#include <errno.h>
#include <fcntl.h>
#include <signal.h>
#include <spawn.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <unistd.h>

extern char **environ;

struct video_pipe {
    char path[1024];
    pid_t child;
    int fd;
    size_t frame_bytes;
};

static int spawn_ffmpeg(const char *path, int width, int height, double rate_hz, int input,
                        pid_t *ret_child)
{
    char size[32], rate[32];
    snprintf(size, sizeof(size), "%dx%d", width, height);
    snprintf(rate, sizeof(rate), "%g", rate_hz);
    /* Behind the simulation in priority: encoding must not take the rasteriser's cores. */
    const char *const argv[] = {
        "nice",       "-n",      "19",        "ffmpeg",     "-nostdin",  "-loglevel",   "error",
        "-y",         "-f",      "rawvideo",  "-pix_fmt",   "rgba",      "-video_size", size,
        "-framerate", rate,      "-i",        "pipe:0",     "-vf",       "vflip",       "-threads",
        "1",          "-c:v",    "libx264",   "-preset",    "ultrafast", "-crf",        "21",
        "-pix_fmt",   "yuv420p", "-movflags", "+faststart", path,        NULL};
    posix_spawn_file_actions_t actions;
    posix_spawn_file_actions_init(&actions);
    posix_spawn_file_actions_adddup2(&actions, input, STDIN_FILENO);
    posix_spawnattr_t
        attributes; /* a group of its own: Ctrl-C is for us, the end of its input for it */
    posix_spawnattr_init(&attributes);
    posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETPGROUP);
    int r = -posix_spawnp(ret_child, "nice", &actions, &attributes, (char *const *)argv, environ);
    posix_spawnattr_destroy(&attributes);
    posix_spawn_file_actions_destroy(&actions);
    return r;
}

bool video_pipe_available(void)
{
    const char *path = getenv("PATH");
    char list[4096], *rest = list;
    snprintf(list, sizeof(list), "%s", path ? path : "");
    for (char *directory; (directory = strsep(&rest, ":"));) {
        char file[4200];
        snprintf(file, sizeof(file), "%s/ffmpeg", directory);
        if (access(file, X_OK) == 0)
            return true;
    }
    return false;
}

int video_pipe_open(const char *path, int width, int height, double rate_hz,
                    struct video_pipe **ret_video, struct diag *diag)
{
    if (width % 2 || height % 2)
        return diag_set(diag, -EINVAL, "%s: H.264 needs an even width and height, not %dx%d", path,
                        width, height);
    if (!video_pipe_available())
        return diag_set(diag, -ENODEV, "%s: ffmpeg is not installed", path);
    int ends[2];
    if (pipe2(ends, O_CLOEXEC) < 0)
        return diag_set(diag, -errno, "cannot make a pipe: %s", strerror(errno));
    struct video_pipe *video = calloc(1, sizeof(*video));
    int r = video ? spawn_ffmpeg(path, width, height, rate_hz, ends[0], &video->child) : -ENOMEM;
    close(ends[0]);
    if (r < 0) {
        close(ends[1]);
        free(video);
        return diag_set(diag, r, "cannot start ffmpeg for %s: %s", path, strerror(-r));
    }
    signal(SIGPIPE, SIG_IGN);
    snprintf(video->path, sizeof(video->path), "%s", path);
    video->fd = ends[1];
    video->frame_bytes = (size_t)width * (size_t)height * 4;
    *ret_video = video;
    return 0;
}

int video_pipe_write(struct video_pipe *video, const uint8_t *rgba, struct diag *diag)
{
    for (size_t done = 0; done < video->frame_bytes;) {
        ssize_t n = write(video->fd, rgba + done, video->frame_bytes - done);
        if (n < 0 && errno == EINTR)
            continue;
        if (n < 0)
            return diag_set(diag, -errno, "%s: ffmpeg no longer takes frames: %s", video->path,
                            strerror(errno));
        done += (size_t)n;
    }
    return 0;
}

int video_pipe_close(struct video_pipe *video, struct diag *diag)
{
    if (!video)
        return 0;
    close(video->fd);
    int status = 0, r = 0;
    while (waitpid(video->child, &status, 0) < 0 && errno == EINTR)
        ;
    if (!WIFEXITED(status) || WEXITSTATUS(status) != 0)
        r = diag_set(diag, -EIO, "%s: ffmpeg failed", video->path);
    free(video);
    return r;
}
