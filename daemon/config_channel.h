/* The configuration's sections as the channel's parameters. */
#pragma once

#include "config/config.h"
#include "daemon/channel.h"

/* Strings stay the configuration's. The window is left alone. */
void config_to_channel(const struct config *config, struct channel_params *ret_params);
