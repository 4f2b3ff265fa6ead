#include "io/modbus_client.h"

#include <errno.h>
#include <modbus/modbus.h>
#include <stdio.h>
#include <string.h>

#include "io/address.h"

static int open_client(const union address *address, unsigned unit, unsigned timeout_ms,
                       modbus_t **ret_modbus)
{
    char host[ADDRESS_TEXT_MAX], port[8];
    address_format(address, host);
    *strrchr(host, ':') = '\0';
    char *name = host[0] == '[' ? host + 1 : host;
    name[strcspn(name, "]")] = '\0';
    snprintf(port, sizeof(port), "%u", address_port(address));
    modbus_t *modbus = modbus_new_tcp_pi(name, port);
    if (!modbus)
        return -ENOMEM;
    modbus_set_slave(modbus, (int)unit);
    modbus_set_response_timeout(modbus, timeout_ms / 1000, timeout_ms % 1000 * 1000);
    *ret_modbus = modbus;
    return 0;
}

/* libmodbus reports a peer's misbehaviour by numbers of its own beyond all errno. */
static int error_code(int error)
{
    return error >= MODBUS_ENOBASE ? -EPROTO : error == EINPROGRESS ? -ETIMEDOUT : -error;
}

int modbus_client_read(const char *server, unsigned unit, unsigned timeout_ms,
                       struct health *ret_health, struct diag *diag)
{
    uint16_t registers[HEALTH_REGISTERS];
    uint8_t bits[HEALTH_BITS];
    union address address;
    modbus_t *modbus;
    int r = address_resolve(server, &address, diag);
    if (r < 0)
        return r;
    if (open_client(&address, unit, timeout_ms, &modbus) < 0)
        return diag_set(diag, -ENOMEM, "%s: out of memory", server);
    if (modbus_connect(modbus) < 0)
        r = diag_set(diag, error_code(errno), "%s: %s", server, strerror(-error_code(errno)));
    else if (modbus_read_input_registers(modbus, 0, HEALTH_REGISTERS, registers) < 0 ||
             modbus_read_input_bits(modbus, 0, HEALTH_BITS, bits) < 0)
        r = diag_set(diag, error_code(errno), "%s: %s", server, modbus_strerror(errno));
    else if (registers[0] != HEALTH_MAP_VERSION)
        r = diag_set(diag, -EPROTO, "%s: map version %u; this otwd reads version %u", server,
                     registers[0], HEALTH_MAP_VERSION);
    else
        health_decode(registers, bits, ret_health);
    modbus_close(modbus);
    modbus_free(modbus);
    return r;
}
