/* Wireshark as an independent reader of what we send: a message goes through text2pcap and tshark,
 * and the fields that tshark found are compared with what was meant. */
#pragma once

#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <unistd.h>

#include "tests/check.h"

#define TSHARK_FIELDS_MAX 48

/* What is to be found: field by field, as numbers. */
struct tshark_expected {
    struct {
        char name[80];
        double value, tolerance; /* the latter relative, or absolute where the value is below 1 */
    } fields[TSHARK_FIELDS_MAX];
    size_t count;
};

static char tshark_folder[] = "/tmp/otwd-tshark-XXXXXX";

static inline void tshark_expect_within(struct tshark_expected *e, const char *name, double value,
                                        double tolerance)
{
    snprintf(e->fields[e->count].name, sizeof(e->fields[0].name), "%s", name);
    e->fields[e->count].tolerance = tolerance;
    e->fields[e->count++].value = value;
}

static inline void tshark_expect(struct tshark_expected *e, const char *name, double value)
{
    tshark_expect_within(e, name, value, 1e-6);
}

static inline void tshark_write_hex(const char *path, const uint8_t *data, size_t size)
{
    FILE *file = fopen(path, "we");
    CHECK(file != NULL);
    if (!file)
        return;
    for (size_t i = 0; i < size; i++) {
        if (i % 16 == 0)
            fprintf(file, "\n%06zx", i);
        fprintf(file, " %02x", data[i]);
    }
    fclose(file);
}

/* True and false come as such. */
static inline double tshark_number(const char *text)
{
    return strcmp(text, "True") == 0 ? 1.0 : strcmp(text, "False") == 0 ? 0.0 : strtod(text, NULL);
}

/* `what` stands for the message in sentences; `port` is where it goes, `protocol` Wireshark's name
 * of what goes there. */
static inline void tshark_check(const char *what, const uint8_t *data, size_t size, unsigned port,
                                const char *protocol, const struct tshark_expected *expected)
{
    char command[8192], line[4096] = "", hex[64], capture[64];
    snprintf(hex, sizeof(hex), "%s/message.txt", tshark_folder);
    snprintf(capture, sizeof(capture), "%s/message.pcap", tshark_folder);
    tshark_write_hex(hex, data, size);
    int length = snprintf(command, sizeof(command),
                          "text2pcap -q -u %u,%u %s %s 2>/dev/null &&"
                          " tshark -r %s -d udp.port==%u,%s -T fields",
                          port + 1, port, hex, capture, capture, port, protocol);
    for (size_t i = 0; i < expected->count; i++)
        length += snprintf(command + length, sizeof(command) - (size_t)length, " -e %s",
                           expected->fields[i].name);
    snprintf(command + length, sizeof(command) - (size_t)length, " 2>/dev/null");
    FILE *pipe = popen(command, "re");
    if (!pipe || !fgets(line, sizeof(line), pipe))
        CHECK_FAIL("no answer to %s", command);
    if (pipe)
        pclose(pipe);
    char *rest = line;
    for (size_t i = 0; i < expected->count; i++) {
        char *text = strsep(&rest, "\t\n");
        double value = text && *text ? tshark_number(text) : NAN, meant = expected->fields[i].value;
        if (!(fabs(value - meant) <= expected->fields[i].tolerance * fmax(fabs(meant), 1.0)))
            CHECK_FAIL("%s: %s is \"%s\", sent as %.9g", what, expected->fields[i].name,
                       text ? text : "", meant);
    }
}

/* Runs the tests, or returns 77 where the tools are missing. */
static inline int tshark_main(const struct check_test *tests, size_t count)
{
    if (system("tshark --version >/dev/null 2>&1 && text2pcap --version >/dev/null 2>&1") != 0) {
        puts("skip: tshark and text2pcap are not installed");
        return 77;
    }
    if (!mkdtemp(tshark_folder))
        return 1;
    int r = check_main(tests, count);
    char command[64];
    snprintf(command, sizeof(command), "rm -r %s", tshark_folder);
    return system(command) == 0 ? r : 1;
}
