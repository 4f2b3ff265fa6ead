#include "render/detail.h"

/* p99.9 of the error over mountains, in the angles of cells where their level ends. */
#define ERROR_CELLS 0.6

double detail_posts(double pixel_rad, double pixel_error)
{
    return ERROR_CELLS / (pixel_rad * pixel_error);
}

double detail_pixel_error(double pixel_rad, double posts)
{
    return ERROR_CELLS / (pixel_rad * posts);
}
