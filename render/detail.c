#include "render/detail.h"

#include <math.h>

#define ERROR_CELLS                                                                                \
    0.6 /* p99.9 of the error over mountains, in the angles of cells where their level ends */
#define HIGH    0.9   /* of the budget: more is too near to the deadline */
#define LOW     0.7   /* less than that there is time to spare */
#define COARSER 1.01  /* a frame */
#define FINER   1.002 /* a frame */
#define FORGET  0.995 /* of the peak, a frame */

double detail_posts(double pixel_rad, double pixel_error)
{
    return ERROR_CELLS / (pixel_rad * pixel_error);
}

double detail_pixel_error(double pixel_rad, double posts)
{
    return ERROR_CELLS / (pixel_rad * posts);
}

void governor_init(struct governor *governor, double asked, double most, double budget_ms)
{
    *governor = (struct governor){
        .asked = asked, .most = fmax(asked, most), .budget_ms = budget_ms, .error = asked};
}

double governor_next(struct governor *governor, double frame_ms, double kept)
{
    governor->peak_ms = fmax(frame_ms, governor->peak_ms * FORGET);
    if (frame_ms > HIGH * governor->budget_ms)
        governor->error = fmin(fmax(governor->error, kept) * COARSER, governor->most);
    else if (governor->peak_ms < LOW * governor->budget_ms)
        governor->error = fmax(governor->error / FINER, governor->asked);
    return governor->error;
}

bool governor_trades(const struct governor *governor)
{
    return governor->error > governor->asked;
}
