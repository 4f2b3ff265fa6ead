/* What address_parse refuses and tools look up; what does not go into a list of senders. */
#include <errno.h>

#include "io/address.h"
#include "tests/check.h"

static void a_name_is_looked_up(void)
{
    union address address;
    char text[ADDRESS_TEXT_MAX];
    CHECK_INT(address_resolve("localhost:502", &address, NULL), 0);
    address_format(&address, text);
    CHECK_STRING(text, "127.0.0.1:502");
    CHECK_INT(address_resolve("[::1]:7", &address, NULL), 0);
    CHECK_INT(address_length(&address), sizeof(address.v6));
}

static void what_is_no_name_with_a_port_is_refused(void)
{
    static const char *const bad[] = {":502", "localhost", "localhost:", "localhost:65536"};
    union address address = {.v4 = {.sin_port = 77}};
    char long_name[300] = "";
    struct diag diag;
    for (size_t i = 0; i < sizeof(bad) / sizeof(bad[0]); i++) {
        CHECK_INT(address_resolve(bad[i], &address, &diag), -EINVAL);
        CHECK_CONTAINS(diag.text, "is not HOST:PORT");
    }
    memset(long_name, 'a', 290);
    strcpy(long_name + 256, ":1");
    CHECK_INT(address_resolve(long_name, &address, &diag), -EINVAL);
    CHECK_INT(address_resolve("no name:1", &address, &diag), -EHOSTUNREACH);
    CHECK_CONTAINS(diag.text, "no name:1: ");
    CHECK_INT(address.v4.sin_port, 77);
}

static void a_list_of_senders_is_bounded(void)
{
    struct allow_list list = {.count = 0};
    struct diag diag;
    char text[ADDRESS_TEXT_MAX + 1];
    memset(text, '1', sizeof(text) - 1);
    text[sizeof(text) - 1] = '\0';
    CHECK_INT(allow_list_add(&list, text, &diag), -EINVAL);
    CHECK_CONTAINS(diag.text, "is not an address or a network");
    for (int i = 0; i < ALLOW_LIST_MAX; i++) {
        snprintf(text, sizeof(text), "10.0.0.%d", i);
        CHECK_INT(allow_list_add(&list, text, &diag), 0);
    }
    CHECK_INT(allow_list_add(&list, "10.0.1.1", &diag), -ENOSPC);
    CHECK_CONTAINS(diag.text, "\"10.0.1.1\" is more than the 32");
    CHECK_INT(list.count, ALLOW_LIST_MAX);
}

static void who_has_no_address_is_on_no_list(void)
{
    struct allow_list list = {.count = 0};
    const union address nameless = {.any = {.sa_family = AF_UNIX}};
    CHECK(allow_list_admits(&list, &nameless));
    CHECK_INT(allow_list_add(&list, "0.0.0.0/0", NULL), 0);
    CHECK_INT(allow_list_add(&list, "::/0", NULL), 0);
    CHECK(!allow_list_admits(&list, &nameless));
}

int main(void)
{
    static const struct check_test tests[] = {
        {"a name is looked up", a_name_is_looked_up},
        {"what is no name with a port is refused", what_is_no_name_with_a_port_is_refused},
        {"a list of senders is bounded", a_list_of_senders_is_bounded},
        {"who has no address is on no list", who_has_no_address_is_on_no_list},
    };
    return CHECK_MAIN(tests);
}
