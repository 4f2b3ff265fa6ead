/* The program was built without GLFW: headless only. */
#include "render/window.h"

#include <errno.h>

int window_create(const struct window_params *params, struct window **ret_window, struct diag *diag)
{
    return diag_set(diag, -ENOTSUP, "this otwd was built without GLFW: only headless display");
}

void window_destroy(struct window *window)
{
}

void window_make_current(struct window *window)
{
}

void window_show(struct window *window, unsigned framebuffer)
{
}

bool window_poll(struct window *window)
{
    return true;
}
