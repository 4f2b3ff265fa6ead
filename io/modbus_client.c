#include "io/modbus_client.h"

#include <errno.h>
#include <modbus/modbus.h>
#include <poll.h>
#include <stdio.h>
#include <string.h>
#include <sys/socket.h>

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

/* libmodbus leaves its socket non-blocking. */
static bool receive_all(int fd, unsigned timeout_ms, uint8_t *ret_data, size_t size)
{
    struct pollfd poll_fd = {.fd = fd, .events = POLLIN};
    while (size > 0) {
        ssize_t n = poll(&poll_fd, 1, (int)timeout_ms) > 0 ? recv(fd, ret_data, size, 0) : -1;
        if (n <= 0)
            return false;
        ret_data += n;
        size -= (size_t)n;
    }
    return true;
}

/* Reads the private object of device identification, which libmodbus does not know. An otwd without
 * a swap lock, or an older one, refuses it: all zero. */
static void read_swap(int fd, unsigned unit, unsigned timeout_ms, struct health_swap *ret_swap)
{
    const uint8_t request[] = {0, 1, 0, 0, 0, 5, (uint8_t)unit, 0x2b, 0x0e, 4, HEALTH_SWAP_OBJECT};
    uint8_t head[7], body[256];
    char text[HEALTH_SWAP_TEXT_MAX] = "";
    *ret_swap = (struct health_swap){0};
    if (send(fd, request, sizeof(request), MSG_NOSIGNAL) != sizeof(request) ||
        !receive_all(fd, timeout_ms, head, sizeof(head)))
        return;
    size_t size = (size_t)(head[4] << 8 | head[5]) - 1;
    if (size > sizeof(body) || size < 9 || !receive_all(fd, timeout_ms, body, size) ||
        body[0] != 0x2b || body[8] != size - 9 || body[8] >= sizeof(text))
        return;
    memcpy(text, body + 9, body[8]);
    health_swap_parse(text, ret_swap);
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
    else {
        health_decode(registers, bits, ret_health);
        read_swap(modbus_get_socket(modbus), unit, timeout_ms, &ret_health->swap);
    }
    modbus_close(modbus);
    modbus_free(modbus);
    return r;
}
