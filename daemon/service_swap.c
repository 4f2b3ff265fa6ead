/* The channels in step, as the daemon tells of them: faults, and what was counted. */
#include <stdio.h>
#include <string.h>

#include "daemon/service_internal.h"

#define ABSENT_NS (NSEC_PER_SEC / 2) /* a channel may be left out for a moment */
#define HOLD_NS   (5 * NSEC_PER_SEC) /* that a fault of a moment stays, so that it is seen */

static const char *why_failed(const struct swap_status *status)
{
    if (status->error)
        return strerror(-status->error);
    return status->counts.namesakes > 0 ? "another channel has the number of this one"
                                        : "messages do not leave";
}

void swap_tick(struct service *service, nsec_t now_ns)
{
    const struct config_swap_lock *config = &service->config.swap_lock;
    const struct swap_status *status = &service->collect.newest.swap;
    struct swap_watch *watch = &service->swap;
    char sentence[192];
    if (!config->group[0] || service->collect.newest.frame == 0)
        return;
    if (status->counts.present == config->channels || watch->complete_ns == 0)
        watch->complete_ns = now_ns;
    service->health.swap = (struct health_swap){.channels = config->channels,
                                                .present = status->counts.present,
                                                .frames = status->counts.frames,
                                                .timeouts = status->counts.timeouts,
                                                .out_of_step = status->counts.out_of_step,
                                                .skew_worst_ns = status->counts.skew_worst_ns};
    snprintf(sentence, sizeof(sentence), "%u of %u channels are in step", status->counts.present,
             config->channels);
    service_set_fault(service, FAULT_CHANNEL_ABSENT, now_ns - watch->complete_ns > ABSENT_NS,
                      sentence);
    uint64_t troubles = status->counts.namesakes + status->unsent;
    if (status->error || troubles > watch->troubles)
        watch->failed_ns = now_ns;
    watch->troubles = troubles;
    snprintf(sentence, sizeof(sentence), "the swap lock of group %s at %s: %s", config->group,
             config->interface, why_failed(status));
    service_set_fault(service, FAULT_SWAP_LOCK_FAILED,
                      watch->failed_ns && now_ns - watch->failed_ns < HOLD_NS, sentence);
}

void swap_tell(const struct service *service)
{
    const struct swap_status *status = &service->collect.newest.swap;
    const struct swap_counts *counts = &status->counts;
    if (counts->frames == 0)
        return;
    log_notice("channel %u of %u: %llu frames in the swap lock, %llu after a time-out, %llu out of "
               "step, worst skew %.3f ms; messages: %llu refused, %llu of strangers",
               service->config.swap_lock.channel, service->config.swap_lock.channels,
               (unsigned long long)counts->frames, (unsigned long long)counts->timeouts,
               (unsigned long long)counts->out_of_step, milliseconds_from_ns(counts->skew_worst_ns),
               (unsigned long long)status->refused, (unsigned long long)counts->strangers);
}
