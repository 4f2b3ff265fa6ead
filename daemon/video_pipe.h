/* Frames into a video file: raw pixels into a pipe, ffmpeg behind it. */
#pragma once

#include <stdint.h>

#include "base/diag.h"

struct video_pipe;

/* Starts ffmpeg with a H.264 MP4 at `path`. -ENOENT where ffmpeg is not installed. */
int video_pipe_open(const char *path, int width, int height, double rate_hz,
                    struct video_pipe **ret_video, struct diag *diag);

/* RGBA, rows from the bottom. Waits while ffmpeg is behind. */
int video_pipe_write(struct video_pipe *video, const uint8_t *rgba, struct diag *diag);

/* Ends the file and waits for ffmpeg; -EIO where it failed. Legal on NULL. */
int video_pipe_close(struct video_pipe *video, struct diag *diag);
