/* What a CIGI host is answered. Part of io/cigi_requests. */
#include <math.h>
#include <string.h>

#include "geo/geographic.h"
#include "io/cigi_pending.h"

#define WATER_CELSIUS     15.0f
#define WATER_CLARITY_PCT 100.0f

static void normal_angles(const double normal_enu[3], float *ret_azimuth_deg,
                          float *ret_elevation_deg)
{
    double flat = hypot(normal_enu[0], normal_enu[1]);
    *ret_azimuth_deg = (float)(atan2(normal_enu[0], normal_enu[1]) * 180.0 / M_PI);
    *ret_elevation_deg = (float)(atan2(normal_enu[2], flat) * 180.0 / M_PI);
}

static void respond_height(const struct cigi_pending *pending, struct cigi_packet *packet)
{
    const struct cigi_height_request *request = &pending->request.height_request;
    const struct cigi_answer *answer = &pending->answer;
    double hat_m = answer->known ? pending->question.from.height_m - answer->height_m : 0.0;
    double hot_m = answer->known ? answer->height_m : 0.0;
    if (request->type != CIGI_HAT_HOT_EXTENDED) {
        bool hot = request->type == CIGI_HOT;
        packet->kind = CIGI_HEIGHT_RESPONSE;
        packet->height_response = (struct cigi_height_response){.request = request->request,
                                                                .valid = answer->known,
                                                                .hot = hot,
                                                                .frame_low = pending->frame_low,
                                                                .height_m = hot ? hot_m : hat_m};
        return;
    }
    packet->kind = CIGI_HEIGHT_EXTENDED;
    packet->height_extended = (struct cigi_height_extended){.request = request->request,
                                                            .valid = answer->known,
                                                            .frame_low = pending->frame_low,
                                                            .hat_m = hat_m,
                                                            .hot_m = hot_m,
                                                            .material = answer->material};
    if (answer->known)
        normal_angles(answer->normal_enu, &packet->height_extended.normal_azimuth_deg,
                      &packet->height_extended.normal_elevation_deg);
}

static double distance_m(const struct geodetic *a, const struct geodetic *b)
{
    double p[3], q[3];
    geocentric_from_geodetic(a, p);
    geocentric_from_geodetic(b, q);
    return sqrt((p[0] - q[0]) * (p[0] - q[0]) + (p[1] - q[1]) * (p[1] - q[1]) +
                (p[2] - q[2]) * (p[2] - q[2]));
}

/* A segment that meets nothing ends at its destination; a vector that meets nothing is not valid.
 */
static void respond_sight(const struct cigi_pending *pending, struct cigi_packet *packet)
{
    const struct cigi_segment_request *segment = &pending->request.segment_request;
    const struct cigi_vector_request *vector = &pending->request.vector_request;
    const struct cigi_question *question = &pending->question;
    const struct cigi_answer *answer = &pending->answer;
    bool of_vector = pending->request.kind == CIGI_VECTOR_REQUEST;
    bool valid = answer->known && (answer->hit || !of_vector);
    uint16_t request = of_vector ? vector->request : segment->request;
    struct cigi_sight_extended all = {.request = request,
                                      .valid = valid,
                                      .range_valid = valid && of_vector,
                                      .visible = valid && !answer->hit,
                                      .frame_low = pending->frame_low,
                                      .count = 1};
    if (valid) {
        const struct geodetic *at = answer->hit ? &answer->at : &question->to;
        all.range_m = answer->hit ? answer->distance_m : distance_m(&question->from, at);
        all.range_m += of_vector ? fmax(vector->least_m, 0.0) : 0.0;
        memcpy(all.place, (double[3]){at->lat_deg, at->lon_deg, at->height_m}, sizeof(all.place));
    }
    if (!question->detailed) {
        packet->kind = CIGI_SIGHT_RESPONSE;
        packet->sight_response = (struct cigi_sight_response){.request = request,
                                                              .valid = valid,
                                                              .visible = all.visible,
                                                              .frame_low = all.frame_low,
                                                              .count = 1,
                                                              .range_m = all.range_m};
        return;
    }
    if (valid && answer->hit) {
        all.material = answer->material;
        normal_angles(answer->normal_enu, &all.normal_azimuth_deg, &all.normal_elevation_deg);
    }
    packet->kind = CIGI_SIGHT_EXTENDED;
    packet->sight_extended = all;
}

/* The weather is the same everywhere: the host's atmosphere. */
static bool write_environment(const struct cigi_pending *pending, const struct cigi_scene *scene,
                              struct cigi_writer *writer)
{
    const struct cigi_environment_request *request = &pending->request.environment_request;
    const struct cigi_atmosphere *air = &scene->atmosphere;
    struct cigi_packet maritime = {.kind = CIGI_MARITIME_RESPONSE};
    struct cigi_packet terrestrial = {.kind = CIGI_TERRESTRIAL_RESPONSE};
    struct cigi_packet weather = {.kind = CIGI_WEATHER_RESPONSE};
    struct cigi_packet aerosol = {.kind = CIGI_AEROSOL_RESPONSE};
    maritime.maritime_response = (struct cigi_maritime_response){
        request->request, (float)pending->answer.height_m, WATER_CELSIUS, WATER_CLARITY_PCT};
    terrestrial.terrestrial_response.request = request->request;
    weather.weather_response = (struct cigi_weather_response){
        request->request, air->humidity_percent, air->temperature_c, air->visibility_m,
        air->wind_mps,    air->wind_up_mps,      air->wind_from_deg, air->pressure_hpa};
    aerosol.aerosol_response.request = request->request;
    bool sea = request->what & CIGI_MARITIME && pending->answer.known;
    return (!sea || cigi_write(writer, &maritime)) &&
           (!(request->what & CIGI_TERRESTRIAL) || cigi_write(writer, &terrestrial)) &&
           (!(request->what & CIGI_WEATHER) || cigi_write(writer, &weather)) &&
           (!(request->what & CIGI_AEROSOL) || cigi_write(writer, &aerosol));
}

bool cigi_pending_respond(const struct cigi_pending *pending, const struct cigi_scene *scene,
                          struct cigi_writer *writer)
{
    struct cigi_packet packet = {.kind = CIGI_POSITION_RESPONSE};
    switch (pending->request.kind) {
    case CIGI_HEIGHT_REQUEST:
        respond_height(pending, &packet);
        break;
    case CIGI_SEGMENT_REQUEST:
    case CIGI_VECTOR_REQUEST:
        respond_sight(pending, &packet);
        break;
    case CIGI_POSITION_REQUEST:
        packet.position_response = pending->position;
        break;
    default:
        return write_environment(pending, scene, writer);
    }
    return cigi_write(writer, &packet);
}
