/* window_pixels TITLE PICTURE.png TOLERANCE DIFFERENCE.png: compares what the X server shows in the
 * window of that title with a picture. Ends with 0 where no colour differs by more than TOLERANCE
 * (of 255), else 1 and writes the difference, sixteen times as strong.
 *
 * window_pixels TITLE WIDTH HEIGHT: gives the window that size. */
#include <png.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <X11/Xlib.h>
#include <X11/Xutil.h>

/* Depth first through the tree of windows; 0 where none has the title. */
static Window find_window(Display *display, Window window, const char *title)
{
    char *name = NULL;
    bool found = XFetchName(display, window, &name) && name && strcmp(name, title) == 0;
    XFree(name);
    if (found)
        return window;
    Window root, parent, *children = NULL, result = 0;
    unsigned count = 0;
    if (!XQueryTree(display, window, &root, &parent, &children, &count))
        return 0;
    for (unsigned i = 0; i < count && !result; i++)
        result = find_window(display, children[i], title);
    XFree(children);
    return result;
}

static unsigned channel(unsigned long pixel, unsigned long mask)
{
    while (!(mask & 1)) {
        mask >>= 1;
        pixel >>= 1;
    }
    return (unsigned)(pixel & mask);
}

static int greatest_difference(XImage *shown, const png_image *picture, png_bytep pixels)
{
    int greatest = 0;
    for (int y = 0; y < (int)picture->height; y++) {
        for (int x = 0; x < (int)picture->width; x++) {
            unsigned long pixel = XGetPixel(shown, x, y);
            const unsigned long masks[3] = {shown->red_mask, shown->green_mask, shown->blue_mask};
            png_bytep rgb = pixels + 3 * ((size_t)y * picture->width + (size_t)x);
            for (int i = 0; i < 3; i++) {
                int difference = abs((int)channel(pixel, masks[i]) - rgb[i]);
                if (difference > greatest)
                    greatest = difference;
                rgb[i] = (png_byte)(difference > 15 ? 255 : difference * 16);
            }
        }
    }
    return greatest;
}

static int resize(Display *display, Window window, char **size)
{
    XResizeWindow(display, window, (unsigned)atoi(size[0]), (unsigned)atoi(size[1]));
    XCloseDisplay(display);
    return 0;
}

int main(int argc, char **argv)
{
    if (argc != 5 && argc != 4)
        return 64;
    Display *display = XOpenDisplay(NULL);
    if (!display)
        return 69;
    Window window = find_window(display, DefaultRootWindow(display), argv[1]);
    if (!window) {
        fprintf(stderr, "no window is titled \"%s\"\n", argv[1]);
        return 69;
    }
    if (argc == 4)
        return resize(display, window, argv + 2);
    png_image picture = {.version = PNG_IMAGE_VERSION};
    if (!png_image_begin_read_from_file(&picture, argv[2])) {
        fprintf(stderr, "%s: %s\n", argv[2], picture.message);
        return 66;
    }
    picture.format = PNG_FORMAT_RGB;
    png_bytep pixels = malloc(PNG_IMAGE_SIZE(picture));
    if (!pixels || !png_image_finish_read(&picture, NULL, pixels, 0, NULL))
        return 66;
    XImage *shown =
        XGetImage(display, window, 0, 0, picture.width, picture.height, AllPlanes, ZPixmap);
    if (!shown)
        return 69;
    int greatest = greatest_difference(shown, &picture, pixels);
    printf("greatest difference %d of 255\n", greatest);
    bool ok = greatest <= atoi(argv[3]);
    if (!ok)
        png_image_write_to_file(&picture, argv[4], 0, pixels, 0, NULL);
    XDestroyImage(shown);
    XCloseDisplay(display);
    free(pixels);
    return ok ? 0 : 1;
}
