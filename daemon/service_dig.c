/* Requests to dig: from the sources to the thread that digs, and its answers back. */
#include "daemon/service_internal.h"

#include <stdio.h>
#include <string.h>
#include <sys/epoll.h>

static const char not_allowed[] = "digging is not allowed (terrain.allow_dig)";
static const char not_possible[] = "the terrain database cannot be dug in: see fault 204";

static struct dig_message answer_to(const struct dig_message *request, enum dig_status status,
                                    const char *text)
{
    struct dig_message answer = {.kind = DIG_ANSWER,
                                 .session = request->session,
                                 .request = request->request,
                                 .status = status};
    snprintf(answer.text, sizeof(answer.text), "%s", text);
    return answer;
}

void service_dig(struct source_slot *slot, const struct dig_message *request,
                 const union address *sender)
{
    struct service *service = slot->service;
    const struct dig_asker asker = {.slot = slot->index, .sender = *sender};
    struct dig_message answer;
    if (!service->config.terrain.allow_dig)
        answer = answer_to(request, DIG_STATUS_REFUSED, not_allowed);
    else if (!service->dig)
        answer = answer_to(request, DIG_STATUS_REFUSED, not_possible);
    else if (dig_thread_ask(service->dig, request, &asker))
        return;
    else
        answer = answer_to(request, DIG_STATUS_BUSY, "too many requests wait");
    pose_source_answer(slot->source, sender, &answer);
}

static void take_reply(struct service *service, const struct dig_reply *reply)
{
    struct pose_source *source =
        reply->asker.slot < service->slot_count ? service->slots[reply->asker.slot].source : NULL;
    if (reply->message.status == DIG_STATUS_DONE || reply->failed)
        service_set_fault(service, FAULT_DIG_FAILED, reply->failed, reply->message.text);
    if (reply->message.status != DIG_STATUS_DONE)
        log_notice("a request to dig was refused: %s", reply->message.text);
    if (source) /* a configuration that was read meanwhile may have closed it */
        pose_source_answer(source, &reply->asker.sender, &reply->message);
}

static int on_replies(sd_event_source *event, int fd, uint32_t revents, void *data)
{
    struct service *service = data;
    struct dig_reply reply;
    while (dig_thread_take(service->dig, &reply))
        take_reply(service, &reply);
    return 0;
}

void service_open_dig(struct service *service, const char *database)
{
    struct diag diag = {""};
    if (!service->config.terrain.allow_dig || !database[0])
        return;
    int r = dig_thread_start(database, &service->dig, &diag);
    if (r == 0 && sd_event_add_io(service->loop, NULL, dig_thread_fd(service->dig), EPOLLIN,
                                  on_replies, service) < 0) {
        dig_thread_stop(service->dig);
        service->dig = NULL;
        r = diag_set(&diag, -1, "the event loop does not take the thread that digs");
    }
    service_set_fault(service, FAULT_DIG_FAILED, r < 0, diag.text);
}
