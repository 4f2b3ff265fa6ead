/* Linked before the daemon's own objects (-Wl,--wrap) to make `otwd_soak`: otwd as it is, but its
 * counters stand where two years of running would have brought them, shortly before they roll
 * over. The uptime is of five weeks; in docs/soak.md stands which rolls over when. */
#include "daemon/service_internal.h"
#include "io/cigi_session.h"
#include "tests/soak/soak.h"

int __real_service_create(const struct service_params *params, struct service **ret_service);
int __wrap_service_create(const struct service_params *params, struct service **ret_service);
int __real_cigi_session_create(const struct cigi_session_params *params,
                               struct cigi_session **ret_session);
int __wrap_cigi_session_create(const struct cigi_session_params *params,
                               struct cigi_session **ret_session);

/* What was counted before the operator's last reset is subtracted from what is told. */
static uint64_t before(uint64_t short_of_roll_over)
{
    return short_of_roll_over - (UINT64_C(1) << 32);
}

int __wrap_service_create(const struct service_params *params, struct service **ret_service)
{
    int status = __real_service_create(params, ret_service);
    if (status != 0)
        return status;
    (*ret_service)->start_ns -= SOAK_UPTIME_S * NSEC_PER_SEC;
    (*ret_service)->base = (struct counter_base){
        .frames = before(SOAK_SHORT_FRAMES),
        .missed = before(SOAK_SHORT_MISSED),
        .accepted = before(SOAK_SHORT_ACCEPTED),
        .rejected = before(SOAK_SHORT_REJECTED),
        .lost = before(SOAK_SHORT_LOST),
        .can_frames = before(SOAK_SHORT_CAN_FRAMES),
        .recorded = before(SOAK_SHORT_RECORDED),
    };
    return 0;
}

int __wrap_cigi_session_create(const struct cigi_session_params *params,
                               struct cigi_session **ret_session)
{
    int r = __real_cigi_session_create(params, ret_session);
    if (r == 0)
        ((struct cigi_link *)cigi_session_link(*ret_session))->ig_frame = -SOAK_SHORT_CIGI_FRAMES;
    return r;
}
