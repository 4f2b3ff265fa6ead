#include "config/schema.h"

#include <string.h>

#include "io/canaerospace.h"

/* Modbus carries visibility in tens of metres in 16 bits: hence its upper limit. A frustum edge at
 * 90 degrees would lie at infinity. */
static const struct config_key keys[] = {
    {"channel.name", "front"},
    {"channel.offset.x_m", "0", -1000, 1000, "m"},
    {"channel.offset.y_m", "0", -1000, 1000, "m"},
    {"channel.offset.z_m", "0", -1000, 1000, "m"},
    {"channel.offset.yaw_deg", "0", -360, 360, "degrees"},
    {"channel.offset.pitch_deg", "0", -90, 90, "degrees"},
    {"channel.offset.roll_deg", "0", -180, 180, "degrees"},
    {"channel.frustum.left_deg", "-30", -85, 85, "degrees"},
    {"channel.frustum.right_deg", "30", -85, 85, "degrees"},
    {"channel.frustum.bottom_deg", "-17.5", -85, 85, "degrees"},
    {"channel.frustum.top_deg", "17.5", -85, 85, "degrees"},
    {"display.backend", "headless"},
    {"display.width", "1920", 16, 16384, "pixels"},
    {"display.height", "1080", 16, 16384, "pixels"},
    {"display.rate_hz", "60", 1, 1000, "Hz"},
    {"display.samples", "1"},
    {"display.monitor", ""},
    {"display.fullscreen", "false"},
    {"display.program_cache", "true"},
    {"swap_lock.group", ""},
    {"swap_lock.interface", "127.0.0.1"},
    {"swap_lock.channel", "1", 1, 16, NULL},
    {"swap_lock.channels", "2", 2, 16, NULL},
    {"swap_lock.timeout_ms", "50", 5, 1000, "ms"},
    {"terrain.database", ""},
    {"terrain.geoid", "egm96"},
    {"terrain.pixel_error", "1.0", 0.1, 100, "pixels"},
    {"terrain.pixel_error_most", "8.0", 0.1, 100, "pixels"},
    {"terrain.technique", "clipmap"},
    {"terrain.cache_mib", "256", 16, 65536, "MiB"},
    {"terrain.allow_dig", "false"},
    {"environment.visibility_m", "40000", 10, 655350, "m"},
    {"environment.time_utc", ""},
    {"environment.atmosphere", "true"},
    {"sources[].name", NULL},
    {"sources[].type", "native"},
    {"sources[].version", "3.3", 3.0, 4.0, NULL},
    {"sources[].listen", NULL},
    {"sources[].reply", NULL},
    {"sources[].view", "0", 0, 65535, NULL},
    {"sources[].database", "1", 1, 127, NULL},
    {"sources[].sync_wait_ms", "0", 0, 1000, "ms"},
    {"sources[].interface", NULL},
    {"sources[].priority", NULL, 1, 255, NULL},
    {"sources[].timeout_ms", "500", 10, 60000, "ms"},
    {"sources[].subscribe", NULL},
    {"sources[].rate_hz", "60", 1, 99, "Hz"},
    {"sources[].entity", "1:1:1"},
    {"sources[].exercise", "0", 0, 255, NULL},
    {"sources[].allow_transmit", "false"},
    {"sources[].redundancy", "0", 0, CANAEROSPACE_REDUNDANCY_MAX, NULL},
    {"sources[].fields[].id", NULL},
    {"sources[].fields[].field", NULL},
    {"sources[].fields[].bit", "0", 0, 63, NULL},
    {"sources[].fields[].bits", "32", 1, 64, NULL},
    {"sources[].fields[].type", "signed"},
    {"sources[].fields[].order", "big"},
    {"sources[].fields[].scale", "1"},
    {"sources[].fields[].offset", "0"},
    {"sources[].fields[].unit", "default"},
    {"sources[].altitude", "default"},
    {"sources[].allow[]", NULL},
    {"entities[].type", "0", 0, 65535, NULL},
    {"entities[].shape", "aircraft"},
    {"entities[].length_m", NULL, 0.1, 500, "m"},
    {"entities[].width_m", NULL, 0.1, 500, "m"},
    {"entities[].height_m", NULL, 0.1, 500, "m"},
    {"pose.mode", "extrapolate"},
    {"pose.delay_ms", "40", 0, 1000, "ms"},
    {"pose.max_extrapolation_ms", "250", 0, 10000, "ms"},
    {"pose.on_loss", "coast"},
    {"health.modbus.listen", "127.0.0.1:1502"},
    {"health.modbus.unit", "1", 1, 247, NULL},
    {"health.modbus.allow_control", "false"},
    {"record.directory", ""},
    {"record.max_mib", "1024", 1, 1 << 24, "MiB"},
};

const struct config_key *config_key_find(const char *path)
{
    for (size_t i = 0; i < sizeof(keys) / sizeof(keys[0]); i++)
        if (strcmp(keys[i].path, path) == 0)
            return &keys[i];
    return NULL;
}
