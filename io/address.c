#include "io/address.h"

#include <arpa/inet.h>
#include <errno.h>
#include <netdb.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* Digits only, no sign, no space, at most `max`. */
static int parse_number(const char *text, unsigned max, unsigned *ret_value)
{
    unsigned value = 0;
    if (!*text)
        return -EINVAL;
    for (; *text; text++) {
        if (*text < '0' || *text > '9')
            return -EINVAL;
        value = value * 10 + (unsigned)(*text - '0');
        if (value > max)
            return -EINVAL;
    }
    *ret_value = value;
    return 0;
}

int address_parse(const char *text, union address *ret_address, struct diag *diag)
{
    const char *colon = strrchr(text, ':');
    unsigned port;
    if (!colon || parse_number(colon + 1, 65535, &port) < 0)
        return diag_set(diag, -EINVAL, "\"%s\" is not ADDRESS:PORT", text);
    char host[ADDRESS_TEXT_MAX];
    size_t length = (size_t)(colon - text);
    bool v6 = length >= 2 && text[0] == '[' && text[length - 1] == ']';
    if (v6) {
        text++;
        length -= 2;
    }
    union address address = {0};
    if (length < sizeof(host)) {
        memcpy(host, text, length);
        host[length] = '\0';
        if (!v6 && inet_pton(AF_INET, host, &address.v4.sin_addr) == 1) {
            address.v4.sin_family = AF_INET;
            address.v4.sin_port = htons((uint16_t)port);
            *ret_address = address;
            return 0;
        }
        if (v6 && inet_pton(AF_INET6, host, &address.v6.sin6_addr) == 1) {
            address.v6.sin6_family = AF_INET6;
            address.v6.sin6_port = htons((uint16_t)port);
            *ret_address = address;
            return 0;
        }
    }
    return diag_set(diag, -EINVAL, "\"%s\" does not begin with a numeric IPv4 or [IPv6] address",
                    text);
}

int address_resolve(const char *text, union address *ret_address, struct diag *diag)
{
    char host[256];
    unsigned port;
    const char *colon = strrchr(text, ':');
    size_t length = colon ? (size_t)(colon - text) : 0;
    if (address_parse(text, ret_address, NULL) == 0)
        return 0;
    if (length == 0 || length >= sizeof(host) || parse_number(colon + 1, 65535, &port) < 0)
        return diag_set(diag, -EINVAL, "\"%s\" is not HOST:PORT with a port from 0 to 65535", text);
    memcpy(host, text, length);
    host[length] = '\0';
    struct addrinfo hints = {.ai_family = AF_INET, .ai_socktype = SOCK_DGRAM}, *found = NULL;
    int r = getaddrinfo(host, colon + 1, &hints, &found);
    if (r != 0)
        return diag_set(diag, -EHOSTUNREACH, "%s: %s", text, gai_strerror(r));
    memcpy(ret_address, found->ai_addr, found->ai_addrlen);
    freeaddrinfo(found);
    return 0;
}

socklen_t address_length(const union address *address)
{
    return address->any.sa_family == AF_INET6 ? sizeof(address->v6) : sizeof(address->v4);
}

uint16_t address_port(const union address *address)
{
    return ntohs(address->any.sa_family == AF_INET6 ? address->v6.sin6_port : address->v4.sin_port);
}

void address_format(const union address *address, char ret_text[ADDRESS_TEXT_MAX])
{
    char host[INET6_ADDRSTRLEN] = "?";
    bool v6 = address->any.sa_family == AF_INET6;
    inet_ntop(address->any.sa_family,
              v6 ? (const void *)&address->v6.sin6_addr : (const void *)&address->v4.sin_addr, host,
              sizeof(host));
    snprintf(ret_text, ADDRESS_TEXT_MAX, v6 ? "[%s]:%u" : "%s:%u", host, address_port(address));
}

static const uint8_t v4_mapped[12] = {[10] = 0xff, [11] = 0xff};

static void mapped_from_v4(const struct in_addr *v4, uint8_t ret_bytes[16])
{
    memcpy(ret_bytes, v4_mapped, 12);
    memcpy(ret_bytes + 12, v4, 4);
}

int allow_list_add(struct allow_list *list, const char *text, struct diag *diag)
{
    if (list->count == ALLOW_LIST_MAX)
        return diag_set(diag, -ENOSPC, "\"%s\" is more than the %d senders that may be allowed",
                        text, ALLOW_LIST_MAX);
    const char *slash = strchr(text, '/');
    size_t length = slash ? (size_t)(slash - text) : strlen(text);
    char host[ADDRESS_TEXT_MAX];
    struct in_addr v4;
    uint8_t network[16];
    if (length >= sizeof(host))
        return diag_set(diag, -EINVAL, "\"%s\" is not an address or a network", text);
    memcpy(host, text, length);
    host[length] = '\0';
    unsigned width = 0;
    if (inet_pton(AF_INET, host, &v4) == 1) {
        width = 32;
        mapped_from_v4(&v4, network);
    } else if (inet_pton(AF_INET6, host, network) == 1) {
        width = 128;
    }
    unsigned prefix = width;
    if (!width || (slash && parse_number(slash + 1, width, &prefix) < 0))
        return diag_set(diag, -EINVAL, "\"%s\" is not an address or a network", text);
    memcpy(list->entries[list->count].network, network, 16);
    list->entries[list->count++].prefix_bits = 128 - width + prefix;
    return 0;
}

static bool same_prefix(const uint8_t a[16], const uint8_t b[16], unsigned bits)
{
    if (memcmp(a, b, bits / 8) != 0)
        return false;
    unsigned rest = bits % 8;
    return rest == 0 || ((a[bits / 8] ^ b[bits / 8]) >> (8 - rest)) == 0;
}

bool allow_list_admits(const struct allow_list *list, const union address *sender)
{
    if (list->count == 0)
        return true;
    uint8_t bytes[16];
    if (sender->any.sa_family == AF_INET6)
        memcpy(bytes, &sender->v6.sin6_addr, 16);
    else if (sender->any.sa_family == AF_INET)
        mapped_from_v4(&sender->v4.sin_addr, bytes);
    else
        return false;
    for (size_t i = 0; i < list->count; i++)
        if (same_prefix(bytes, list->entries[i].network, list->entries[i].prefix_bits))
            return true;
    return false;
}
