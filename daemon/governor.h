/* Who decides how fine the terrain is when there is no time for what was asked. */
#pragma once

#include <stdbool.h>

/* Trades accuracy for time: the error grows before a deadline is missed and goes back to what was
 * asked once there has been time to spare for seconds. Between the two it stays. It changes by so
 * little a frame that nothing is seen to pop. */
struct governor {
    double asked, most; /* pixels; where they are equal there is nothing to trade */
    double budget_ms;   /* of a frame */
    double error;       /* what is kept now */
    double peak_ms;     /* of the last seconds */
};

void governor_init(struct governor *governor, double asked, double most, double budget_ms);

/* Takes what the last frame took and the error that it kept (renderer_frame.pixel_error: the
 * clipmap may not reach far enough for less); returns the error to draw the next one with. */
double governor_next(struct governor *governor, double frame_ms, double kept);

/* Whether it is more than was asked. */
bool governor_trades(const struct governor *governor);
