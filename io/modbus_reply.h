/* One Modbus request to one answer; no sockets but the private pair that libmodbus writes into.
 * Private to io/modbus_server.c and its tests. */
#pragma once

#include <stddef.h>
#include <stdint.h>

#include "io/modbus_server.h"

#define MODBUS_ADU_MAX 260 /* 7 bytes of header, 253 of PDU */
#define MODBUS_HEADER  7   /* transaction, protocol, length, unit */
#define MODBUS_COILS   3
#define MODBUS_HOLDING 2

struct modbus_replier {
    struct modbus_server_params params; /* strings borrowed */
    void *modbus;                       /* modbus_t, owned */
    void *mapping;                      /* modbus_mapping_t, owned */
    char swap[HEALTH_SWAP_TEXT_MAX];
    int pair[2]; /* libmodbus writes its answers into [0], we take them from [1] */
};

/* Returns 0 or -errno; finish it whatever was returned. */
int modbus_replier_init(struct modbus_replier *replier, const struct modbus_server_params *params);
void modbus_replier_finish(struct modbus_replier *replier);

/* Everything but the number of clients. */
void modbus_replier_publish(struct modbus_replier *replier, const struct health *health);
void modbus_replier_publish_clients(struct modbus_replier *replier, unsigned clients);

/* Answers the complete ADU `request` (header and PDU, `size` >= 8) into `ret_answer`, after calling
 * the control callback for what it wrote. Returns the size of the answer, or -errno. */
int modbus_replier_answer(struct modbus_replier *replier, const uint8_t *request, size_t size,
                          uint8_t ret_answer[MODBUS_ADU_MAX]);
