#include "daemon/config_channel.h"

void config_to_channel(const struct config *config, struct channel_params *ret_params)
{
    const struct config_offset *offset = &config->channel.offset;
    const struct config_frustum *frustum = &config->channel.frustum;
    struct window *window = ret_params->window;
    *ret_params = (struct channel_params){
        .width = (int)config->display.width,
        .height = (int)config->display.height,
        .samples = (int)config->display.samples,
        .geometry = {.offset_m = {offset->x_m, offset->y_m, offset->z_m},
                     .yaw_deg = offset->yaw_deg,
                     .pitch_deg = offset->pitch_deg,
                     .roll_deg = offset->roll_deg,
                     .left_deg = frustum->left_deg,
                     .right_deg = frustum->right_deg,
                     .bottom_deg = frustum->bottom_deg,
                     .top_deg = frustum->top_deg},
        .terrain_path = config->terrain.database,
        .geoid = config->terrain.geoid,
        .technique = config_technique_name(config->terrain.technique),
        .pixel_error = config->terrain.pixel_error,
        .cache_mib = config->terrain.cache_mib,
        .visibility_m = config->environment.visibility_m,
        .clear_air = !config->environment.atmosphere,
        .cache_programs = config->display.program_cache,
        .window = window,
    };
}
