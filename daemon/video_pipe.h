/* Frames into a video file: raw pixels into a pipe, ffmpeg behind it. */
#pragma once

#include <stdbool.h>
#include <stdint.h>

#include "base/diag.h"

struct video_pipe;

/* True where ffmpeg is installed. */
bool video_pipe_available(void);

/* Starts ffmpeg with a H.264 MP4 at `path`. -ENODEV where ffmpeg is not installed, -EINVAL where a
 * side is odd. */
int video_pipe_open(const char *path, int width, int height, double rate_hz,
                    struct video_pipe **ret_video, struct diag *diag);

/* RGBA, rows from the bottom. Waits while ffmpeg is behind. */
int video_pipe_write(struct video_pipe *video, const uint8_t *rgba, struct diag *diag);

/* Ends the file and waits for ffmpeg; -EIO where it failed. Legal on NULL. */
int video_pipe_close(struct video_pipe *video, struct diag *diag);
