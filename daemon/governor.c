#include "daemon/governor.h"

#include <math.h>

#define HIGH    0.9   /* of the budget: more is too near to the deadline */
#define LOW     0.7   /* less than that there is time to spare */
#define COARSER 1.01  /* a frame */
#define FINER   1.002 /* a frame */
#define FORGET  0.995 /* of the peak, a frame */

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
