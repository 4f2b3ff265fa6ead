/* Internet addresses as an operator writes them: "127.0.0.1:5500", "[::1]:5500", "10.1.0.0/16".
 * Numbers only: a name that must be looked up could stall the caller. Pure; any thread. */
#pragma once

#include <netinet/in.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <sys/socket.h>

#include "base/diag.h"

#define ADDRESS_TEXT_MAX 64

union address {
    struct sockaddr any;
    struct sockaddr_in v4;
    struct sockaddr_in6 v6;
};

/* "A.B.C.D:PORT" or "[V6]:PORT", port 0 to 65535. Returns 0, or -EINVAL with a sentence. */
int address_parse(const char *text, union address *ret_address, struct diag *diag);

/* The same, or "NAME:PORT" by a look-up, which may take its time: for tools, not for the
 * daemon. Returns 0, -EINVAL, or -EHOSTUNREACH where the name is not known. */
int address_resolve(const char *text, union address *ret_address, struct diag *diag);

socklen_t address_length(const union address *address);
uint16_t address_port(const union address *address);

/* Writes "address:port", brackets around version 6. */
void address_format(const union address *address, char ret_text[ADDRESS_TEXT_MAX]);

/* A set of networks: those who may send to a source. */
#define ALLOW_LIST_MAX 32

struct allow_list {
    struct {
        uint8_t network[16]; /* version 4 as ::ffff:a.b.c.d */
        unsigned prefix_bits;
    } entries[ALLOW_LIST_MAX];
    size_t count;
};

/* Adds "A.B.C.D", "A.B.C.D/N", "V6" or "V6/N". Returns 0, -EINVAL or -ENOSPC with a sentence. */
int allow_list_add(struct allow_list *list, const char *text, struct diag *diag);

/* True where the list is empty (whoever reaches the socket may send) or an entry holds `sender`. */
bool allow_list_admits(const struct allow_list *list, const union address *sender);
