#include <errno.h>
#include <sys/socket.h>

#include "io/modbus_reply.h"
#include "tests/check.h"

static bool recv_fails;

/* In the place of the C library's. */
ssize_t recv(int fd, void *bytes, size_t size, int flags)
{
    if (recv_fails) {
        errno = ENOMEM;
        return -1;
    }
    return recvfrom(fd, bytes, size, flags, NULL, NULL);
}

static uint32_t random_state = 1;

/* Numerical Recipes' linear congruential generator: the same requests on every machine. */
static uint8_t random_byte(void)
{
    random_state = random_state * 1664525u + 1013904223u;
    return (uint8_t)(random_state >> 24);
}

static void any_request_has_a_well_formed_answer(void)
{
    static const uint8_t functions[] = {1, 2, 3, 4, 5, 6, 7, 15, 16, 17, 22, 23, 43, 200};
    struct modbus_replier replier;
    struct modbus_server_params params = {.unit = 1, .allow_control = true};
    CHECK_INT(modbus_replier_init(&replier, &params), 0);
    unsigned odd = 0, accepted = 0;
    for (unsigned i = 0; i < 50000; i++) {
        uint8_t request[MODBUS_ADU_MAX] = {0x12, 0x34, 0, 0, 0, 0, 1}, answer[MODBUS_ADU_MAX];
        size_t size = MODBUS_HEADER + 1 + (random_byte() & 1 ? 4u : random_byte() % 253u);
        for (size_t k = MODBUS_HEADER; k < size; k++)
            request[k] = random_byte() & 1 ? 0 : random_byte();
        request[5] = (uint8_t)(size - 6);
        request[MODBUS_HEADER] = functions[random_byte() % sizeof(functions)];
        if (random_byte() & 1 && size > 12) /* often a byte count that fits */
            request[MODBUS_HEADER + 5] = (uint8_t)(size - MODBUS_HEADER - 6);
        int got = modbus_replier_answer(&replier, request, size, answer);
        bool refused = got > 8 && answer[7] == (request[7] | 0x80);
        bool fits = got > 8 && got <= MODBUS_ADU_MAX && memcmp(answer, request, 4) == 0 &&
                    (answer[4] << 8 | answer[5]) == got - 6 && answer[6] == 1;
        odd += !fits || (!refused && answer[7] != request[7]) || (refused && got != 9);
        accepted += fits && !refused;
    }
    CHECK_INT(odd, 0);
    CHECK(accepted > 100 && accepted < 40000);
    modbus_replier_finish(&replier);
    modbus_replier_finish(&replier); /* legal on a finished one */
}

static void an_answer_that_could_not_be_taken_is_not_the_next_ones(void)
{
    struct modbus_replier replier;
    struct modbus_server_params params = {.unit = 1};
    CHECK_INT(modbus_replier_init(&replier, &params), 0);
    uint8_t answer[MODBUS_ADU_MAX];
    for (uint8_t transaction = 1; transaction <= 4; transaction++) {
        const uint8_t request[] = {0, transaction, 0, 0, 0, 6, 1, 4, 0, 0, 0, transaction};
        recv_fails = transaction <= 2;
        int r = modbus_replier_answer(&replier, request, sizeof(request), answer);
        if (recv_fails) {
            CHECK_INT(r, -ENOMEM);
            continue;
        }
        CHECK_INT(r, MODBUS_HEADER + 2 + 2 * transaction);
        CHECK_INT(answer[1], transaction);
    }
    modbus_replier_finish(&replier);
}

int main(void)
{
    static const struct check_test tests[] = {
        {"any request has a well-formed answer", any_request_has_a_well_formed_answer},
        {"an answer that could not be taken is not the next one's",
         an_answer_that_could_not_be_taken_is_not_the_next_ones},
    };
    return CHECK_MAIN(tests);
}
