#include "io/modbus_reply.h"

#include <assert.h>
#include <errno.h>
#include <math.h>
#include <modbus/modbus.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#define FC_ENCAPSULATED        0x2b /* function 43 */
#define MEI_DEVICE_IDENTIFYING 0x0e /* its type 14 */
#define CONFORMITY_REGULAR     0x82 /* basic and regular objects, also one by one */

#define MINUTES_A_DAY 1440

static unsigned be16(const uint8_t *bytes)
{
    return (unsigned)bytes[0] << 8 | bytes[1];
}

int modbus_replier_init(struct modbus_replier *replier, const struct modbus_server_params *params)
{
    *replier = (struct modbus_replier){.params = *params, .pair = {-1, -1}};
    if (socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC | SOCK_NONBLOCK, 0, replier->pair) < 0)
        return -errno;
    modbus_t *modbus = modbus_new_tcp("127.0.0.1", 1); /* never connected: the pair is its socket */
    replier->modbus = modbus;
    replier->mapping =
        modbus_mapping_new(params->allow_control ? MODBUS_COILS : 0, HEALTH_BITS,
                           params->allow_control ? MODBUS_HOLDING : 0, HEALTH_REGISTERS);
    if (!modbus || !replier->mapping)
        return -ENOMEM;
    modbus_set_socket(modbus, replier->pair[0]);
    /* libmodbus sleeps this long before it refuses a malformed request. */
    modbus_set_response_timeout(modbus, 0, 1);
    modbus_replier_publish(replier,
                           &(struct health){.pose_age_ns = -1, .height_above_terrain_m = NAN});
    return 0;
}

void modbus_replier_finish(struct modbus_replier *replier)
{
    if (replier->mapping)
        modbus_mapping_free(replier->mapping);
    if (replier->modbus)
        modbus_free(replier->modbus);
    for (int i = 0; i < 2; i++)
        if (replier->pair[i] >= 0)
            close(replier->pair[i]);
    *replier = (struct modbus_replier){.pair = {-1, -1}};
}

void modbus_replier_publish_clients(struct modbus_replier *replier, unsigned clients)
{
    modbus_mapping_t *mapping = replier->mapping;
    mapping->tab_input_registers[HEALTH_REGISTER_CLIENTS] = (uint16_t)clients;
}

void modbus_replier_publish(struct modbus_replier *replier, const struct health *health)
{
    modbus_mapping_t *mapping = replier->mapping;
    struct health own = *health;
    own.modbus_clients = mapping->tab_input_registers[HEALTH_REGISTER_CLIENTS];
    health_encode(&own, mapping->tab_input_registers, mapping->tab_input_bits);
    health_swap_format(&health->swap, replier->swap);
    if (!replier->params.allow_control)
        return;
    double tens = health->visibility_m / 10.0;
    mapping->tab_bits[0] = health->frozen;
    mapping->tab_registers[0] = tens >= 65535.0 ? 65535 : tens >= 1.0 ? (uint16_t)(tens + 0.5) : 1;
    mapping->tab_registers[1] = (uint16_t)(health->utc_minutes % MINUTES_A_DAY);
}

/* Completes an answer whose PDU of `pdu_size` bytes stands behind the header already. */
static int finish_answer(const uint8_t *request, size_t pdu_size, uint8_t *answer)
{
    memcpy(answer, request, MODBUS_HEADER);
    answer[4] = (uint8_t)((pdu_size + 1) >> 8);
    answer[5] = (uint8_t)(pdu_size + 1);
    return (int)(MODBUS_HEADER + pdu_size);
}

static int refuse(const uint8_t *request, uint8_t exception, uint8_t *answer)
{
    answer[MODBUS_HEADER] = request[MODBUS_HEADER] | 0x80;
    answer[MODBUS_HEADER + 1] = exception;
    return finish_answer(request, 2, answer);
}

/* Objects of device identification, V1.1b3 section 6.21: 0..2 basic, 3..6 regular; from 128
 * private. */
static const char *identity(const struct modbus_replier *replier, unsigned object)
{
    switch (object) {
    case 0:
        return "otwd";
    case 1:
        return "otwd";
    case 2:
        return replier->params.version ? replier->params.version : "";
    case 4:
        return "out-the-window daemon";
    case 6:
        return replier->params.channel ? replier->params.channel : "";
    case HEALTH_SWAP_OBJECT:
        return replier->swap[0] ? replier->swap : NULL;
    default:
        return NULL;
    }
}

static size_t put_object(const struct modbus_replier *replier, unsigned object, uint8_t *out)
{
    const char *text = identity(replier, object);
    /* five of them fit into one PDU; a private one is read alone */
    size_t length = strnlen(text, object < HEALTH_SWAP_OBJECT ? 60 : HEALTH_SWAP_TEXT_MAX);
    out[0] = (uint8_t)object;
    out[1] = (uint8_t)length;
    memcpy(out + 2, text, length);
    return length + 2;
}

static int identify(const struct modbus_replier *replier, const uint8_t *request, size_t size,
                    uint8_t *answer)
{
    const uint8_t *pdu = request + MODBUS_HEADER;
    if (size < MODBUS_HEADER + 2 || pdu[1] != MEI_DEVICE_IDENTIFYING)
        return refuse(request, MODBUS_EXCEPTION_ILLEGAL_FUNCTION, answer);
    if (size != MODBUS_HEADER + 4 || pdu[2] < 1 || pdu[2] > 4)
        return refuse(request, MODBUS_EXCEPTION_ILLEGAL_DATA_VALUE, answer);
    unsigned code = pdu[2], first = pdu[3];
    bool known = (first <= 6 || code == 4) && identity(replier, first);
    if (code == 4 && !known)
        return refuse(request, MODBUS_EXCEPTION_ILLEGAL_DATA_ADDRESS, answer);
    unsigned last = code == 4 ? first : code == 1 ? 2 : 6;
    if (!known || first > last)
        first = 0;
    uint8_t *out = answer + MODBUS_HEADER;
    const uint8_t head[7] = {FC_ENCAPSULATED, MEI_DEVICE_IDENTIFYING, (uint8_t)code,
                             CONFORMITY_REGULAR};
    memcpy(out, head, sizeof(head)); /* nothing more follows, next object 0 */
    size_t used = sizeof(head);
    for (unsigned object = first; object <= last; object++) {
        if (!identity(replier, object))
            continue;
        out[6]++;
        used += put_object(replier, object, out + used);
    }
    return finish_answer(request, used, answer);
}

static bool is_control(unsigned function)
{
    return function == MODBUS_FC_READ_COILS || function == MODBUS_FC_READ_HOLDING_REGISTERS ||
           function == MODBUS_FC_WRITE_SINGLE_COIL || function == MODBUS_FC_WRITE_SINGLE_REGISTER ||
           function == MODBUS_FC_WRITE_MULTIPLE_COILS ||
           function == MODBUS_FC_WRITE_MULTIPLE_REGISTERS;
}

static bool exists(const struct modbus_replier *replier, unsigned function)
{
    return function == MODBUS_FC_READ_DISCRETE_INPUTS ||
           function == MODBUS_FC_READ_INPUT_REGISTERS ||
           (replier->params.allow_control && is_control(function));
}

/* The PDU is as long as its function and its own byte count say. */
static bool length_fits(const uint8_t *pdu, size_t size)
{
    bool coils = pdu[0] == MODBUS_FC_WRITE_MULTIPLE_COILS;
    if (!coils && pdu[0] != MODBUS_FC_WRITE_MULTIPLE_REGISTERS)
        return size == 5;
    if (size < 6)
        return false;
    unsigned quantity = be16(pdu + 3), bytes = pdu[5];
    return size == 6u + bytes && bytes == (coils ? (quantity + 7) / 8 : quantity * 2);
}

static bool register_value_allowed(unsigned address, unsigned value)
{
    return address == 0 ? value >= 1 : address == 1 ? value < MINUTES_A_DAY : true;
}

/* Whether the values that a request would write are possible. Addresses are libmodbus's to check:
 * it refuses those that do not exist. */
static bool values_allowed(const uint8_t *pdu)
{
    unsigned address = be16(pdu + 1);
    if (pdu[0] == MODBUS_FC_WRITE_SINGLE_REGISTER)
        return register_value_allowed(address, be16(pdu + 3));
    if (pdu[0] != MODBUS_FC_WRITE_MULTIPLE_REGISTERS || address + be16(pdu + 3) > MODBUS_HOLDING)
        return true;
    for (unsigned i = 0; i < be16(pdu + 3); i++)
        if (!register_value_allowed(address + i, be16(pdu + 6 + 2 * i)))
            return false;
    return true;
}

static void tell(const struct modbus_replier *replier, enum modbus_control_kind kind,
                 uint32_t value)
{
    const struct modbus_control control = {.kind = kind, .value = value};
    if (replier->params.control)
        replier->params.control(replier->params.context, &control);
}

static void tell_coil(const struct modbus_replier *replier, unsigned address)
{
    modbus_mapping_t *mapping = replier->mapping;
    if (address == 0) {
        tell(replier, MODBUS_CONTROL_FREEZE, mapping->tab_bits[0]);
    } else if (mapping->tab_bits[address]) {
        mapping->tab_bits[address] = 0; /* a push button, not a switch */
        tell(replier, address == 1 ? MODBUS_CONTROL_SNAPSHOT : MODBUS_CONTROL_RESET_COUNTERS, 1);
    }
}

static void tell_register(const struct modbus_replier *replier, unsigned address)
{
    modbus_mapping_t *mapping = replier->mapping;
    if (address == 0)
        tell(replier, MODBUS_CONTROL_VISIBILITY, mapping->tab_registers[0] * 10u);
    else
        tell(replier, MODBUS_CONTROL_UTC_MINUTES, mapping->tab_registers[1]);
}

static void tell_written(const struct modbus_replier *replier, const uint8_t *pdu)
{
    bool many =
        pdu[0] == MODBUS_FC_WRITE_MULTIPLE_COILS || pdu[0] == MODBUS_FC_WRITE_MULTIPLE_REGISTERS;
    bool coil = pdu[0] == MODBUS_FC_WRITE_SINGLE_COIL || pdu[0] == MODBUS_FC_WRITE_MULTIPLE_COILS;
    bool reg =
        pdu[0] == MODBUS_FC_WRITE_SINGLE_REGISTER || pdu[0] == MODBUS_FC_WRITE_MULTIPLE_REGISTERS;
    unsigned address = be16(pdu + 1), count = many ? be16(pdu + 3) : 1;
    for (unsigned i = 0; i < count && (coil || reg); i++) {
        if (coil)
            tell_coil(replier, address + i);
        else
            tell_register(replier, address + i);
    }
}

static int answer_by_library(struct modbus_replier *replier, const uint8_t *request, size_t size,
                             uint8_t *answer)
{
    /* An answer that could not be taken would be the next request's, and so on for ever. */
    while (recv(replier->pair[1], answer, MODBUS_ADU_MAX, MSG_DONTWAIT) > 0)
        ;
    if (modbus_reply(replier->modbus, request, (int)size, replier->mapping) < 0)
        return refuse(request, MODBUS_EXCEPTION_SLAVE_OR_SERVER_FAILURE, answer);
    ssize_t got = recv(replier->pair[1], answer, MODBUS_ADU_MAX, MSG_DONTWAIT);
    if (got < MODBUS_HEADER + 2)
        return got < 0 ? -errno : -EIO;
    if (!(answer[MODBUS_HEADER] & 0x80))
        tell_written(replier, request + MODBUS_HEADER);
    return (int)got;
}

static bool is_addressed(const struct modbus_replier *replier, unsigned unit)
{
    return unit == replier->params.unit || unit == 0 || unit == 255;
}

int modbus_replier_answer(struct modbus_replier *replier, const uint8_t *request, size_t size,
                          uint8_t ret_answer[MODBUS_ADU_MAX])
{
    assert(size > MODBUS_HEADER && size <= MODBUS_ADU_MAX);
    const uint8_t *pdu = request + MODBUS_HEADER;
    if (!is_addressed(replier, request[6]))
        return refuse(request, MODBUS_EXCEPTION_GATEWAY_TARGET, ret_answer);
    if (pdu[0] == FC_ENCAPSULATED)
        return identify(replier, request, size, ret_answer);
    if (!exists(replier, pdu[0]))
        return refuse(request, MODBUS_EXCEPTION_ILLEGAL_FUNCTION, ret_answer);
    if (!length_fits(pdu, size - MODBUS_HEADER) || !values_allowed(pdu))
        return refuse(request, MODBUS_EXCEPTION_ILLEGAL_DATA_VALUE, ret_answer);
    return answer_by_library(replier, request, size, ret_answer);
}
