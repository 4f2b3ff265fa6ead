#include "io/cigi_host.h"

#include <errno.h>

#define NS_PER_TICK 10000

int cigi_host_receive(struct cigi_host *host, const void *data, size_t size,
                      struct cigi_reader *ret_reader, struct rejection *ret_rejection)
{
    struct cigi_reader reader;
    struct cigi_packet packet;
    int r;
    if (cigi_read_begin(data, size, &reader, ret_rejection) < 0 ||
        cigi_read(&reader, &packet, ret_rejection) != CIGI_PACKET)
        return -EBADMSG;
    if (packet.kind != CIGI_START_OF_FRAME)
        return reject(ret_rejection, REJECT_MAGIC, 0, "it begins with %s",
                      cigi_layouts[packet.kind].name);
    if (reader.format.major != host->format.major || reader.format.minor != host->format.minor)
        return reject(ret_rejection, REJECT_VERSION, 0, "CIGI %u.%u is answered, not %u.%u",
                      reader.format.major, reader.format.minor, host->format.major,
                      host->format.minor);
    struct cigi_start_of_frame seen = packet.start_of_frame;
    struct cigi_reader rest = reader;
    while ((r = cigi_read(&rest, &packet, NULL)) != CIGI_END) {
        if (r == CIGI_PACKET && packet.kind == CIGI_START_OF_FRAME)
            return reject(ret_rejection, REJECT_FIELD, rest.offset, "a second Start of Frame");
    }
    host->gaps += host->has_seen && seen.ig_frame != host->seen.ig_frame + 1;
    host->database_seen = seen.database != 0 && (seen.database == host->database ||
                                                 seen.database == -(int)host->database);
    host->seen = seen;
    host->has_seen = true;
    if (ret_reader)
        *ret_reader = reader;
    return 0;
}

void cigi_host_begin(struct cigi_host *host, nsec_t now_ns, uint8_t ret_data[CIGI_MESSAGE_MAX],
                     struct cigi_writer *ret_writer)
{
    bool one_counter = host->format.major == 3 && host->format.minor < 2;
    bool operates = host->has_seen && host->seen.mode == CIGI_OPERATE;
    struct cigi_packet packet = {.kind = CIGI_IG_CONTROL};
    packet.ig_control = (struct cigi_ig_control){
        .database = operates && !host->database_seen ? (int8_t)host->database : 0,
        .mode = CIGI_OPERATE,
        .timestamp_valid = 1,
        .extrapolate = 1,
        .host_frame = one_counter ? host->seen.ig_frame : host->frame,
        .timestamp = (uint32_t)(now_ns / NS_PER_TICK),
        .ig_frame = host->seen.ig_frame,
    };
    host->frame++;
    *ret_writer = (struct cigi_writer){
        .data = ret_data, .capacity = CIGI_MESSAGE_MAX, .format = host->format};
    cigi_write(ret_writer, &packet);
}

static bool put_velocity(struct cigi_writer *writer, uint16_t entity, const struct pose *pose)
{
    struct cigi_packet packet = {.kind = CIGI_RATE};
    packet.rate.entity = entity;
    for (int i = 0; i < 3; i++)
        packet.rate.linear_mps[i] = (float)pose->velocity_ned_mps[i];
    return !(pose->valid & POSE_VELOCITY) || cigi_write(writer, &packet);
}

bool cigi_host_put_pose(const struct cigi_host *host, struct cigi_writer *writer, uint16_t entity,
                        uint16_t type, const struct pose *pose)
{
    struct cigi_placement placement = {
        .roll_deg = (float)pose->attitude.roll_deg,
        .pitch_deg = (float)pose->attitude.pitch_deg,
        .yaw_deg = (float)pose->attitude.heading_deg,
        .place = {pose->position.lat_deg, pose->position.lon_deg, pose->position.height_m}};
    struct cigi_packet control = {.kind = CIGI_ENTITY_CONTROL};
    struct cigi_packet position = {.kind = CIGI_ENTITY_POSITION};
    control.entity_control = (struct cigi_entity_control){.entity = entity,
                                                          .state = CIGI_ACTIVE,
                                                          .alpha = UINT8_MAX,
                                                          .extrapolate = 1,
                                                          .type = type,
                                                          .placement = placement};
    position.entity_position =
        (struct cigi_entity_position){.entity = entity, .placement = placement};
    return cigi_write(writer, &control) &&
           (host->format.major < 4 || cigi_write(writer, &position)) &&
           put_velocity(writer, entity, pose);
}
