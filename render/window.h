/* How a frame is shown: a window with its own GL context (GLFW). Creation and events belong to the
 * main thread; the rest to the thread in which the context is made current. */
#pragma once

#include <stdbool.h>

#include "base/diag.h"

struct window;

struct window_params {
    const char *title;
    int width, height;
    const char *monitor; /* name of the monitor for full screen; "" = the primary one */
    bool fullscreen;
};

/* -ENODEV where there is no display, no such monitor, or no OpenGL 4.5; -ENOTSUP where the program
 * was built without GLFW. */
int window_create(const struct window_params *params, struct window **ret_window,
                  struct diag *diag);
/* Legal on NULL. */
void window_destroy(struct window *window);

void window_make_current(struct window *window);
/* In that thread, before it ends: the window can then be destroyed elsewhere. Legal on NULL. */
void window_release(struct window *window);

/* Copies the framebuffer object's colour into the window, 1:1 from the lower left where the sizes
 * are equal and scaled where they are not, and swaps. Of a window that is minimised or has no size
 * there is nothing to show: it returns at once. */
void window_show(struct window *window, unsigned framebuffer);

/* Handles pending window events; true once the user has closed it. Main thread. */
bool window_poll(struct window *window);
