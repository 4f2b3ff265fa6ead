/* Which sources a new configuration leaves as they are. */
#include "tests/config_fixture.h"

/* Each line is of a source; only the first two say the same. */
static void any_key_tells_two_sources_apart(void)
{
    static const char *const lines[] = {
        "{name: a, type: cigi, allow: [10.0.0.1]}",
        "{allow: [10.0.0.1], type: cigi, name: a}",
        "{name: b, type: cigi, allow: [10.0.0.1]}",
        "{name: a, type: cigi, allow: [10.0.0.2]}",
        "{name: a, type: cigi, allow: [10.0.0.1, 10.0.0.2]}",
        "{name: a, type: cigi, allow: [10.0.0.1], view: 1}",
        "{name: a, type: cigi, allow: [10.0.0.1], database: 2}",
        "{name: a, type: cigi, allow: [10.0.0.1], sync_wait_ms: 8}",
        "{name: a, type: dis, entity: '1:1:2'}",
        "{name: a, type: dis, entity: '1:1:2', exercise: 1}",
        "{name: a, type: xplane}",
        "{name: a, type: xplane, rate_hz: 30}",
        "{name: a, type: xplane, subscribe: ''}",
        "{name: a, type: canaerospace}",
        "{name: a, type: canaerospace, allow_transmit: true}",
    };
    enum { COUNT = sizeof(lines) / sizeof(lines[0]) };
    struct config configs[COUNT];
    char text[256];
    for (int i = 0; i < COUNT; i++) {
        struct config_errors errors;
        snprintf(text, sizeof(text), "sources:\n- %s\n", lines[i]);
        CHECK_INT(load(text, &configs[i], &errors), 0);
        for (int k = 0; k <= i; k++)
            if (config_source_same(configs[i].sources, configs[k].sources) != (k == i || i == 1))
                CHECK_FAIL("%s | %s", lines[i], lines[k]);
        config_errors_finish(&errors);
    }
    for (int i = 0; i < COUNT; i++)
        config_finish(&configs[i]);
}

static void a_can_tables_rows_tell_two_sources_apart(void)
{
    static const char form[] = "sources:\n- type: can-table\n  fields:\n"
                               "  - {id: '101', field: latitude}\n"
                               "  - {id: '102', field: longitude}\n"
                               "  - {id: '103', field: height, scale: %s}\n";
    struct config one, another;
    struct config_errors errors;
    char text[256];
    snprintf(text, sizeof(text), form, "1");
    CHECK_INT(load(text, &one, &errors), 0);
    snprintf(text, sizeof(text), form, "2");
    CHECK_INT(load(text, &another, &errors), 0);
    CHECK(config_source_same(one.sources, one.sources));
    CHECK(!config_source_same(one.sources, another.sources));
    config_finish(&one);
    config_finish(&another);
    config_errors_finish(&errors);
}

int main(void)
{
    int fd = mkstemp(file_path);
    if (fd < 0) {
        perror(file_path);
        return 1;
    }
    close(fd);
    static const struct check_test tests[] = {
        {"any key tells two sources apart", any_key_tells_two_sources_apart},
        {"a CAN table's rows tell two sources apart", a_can_tables_rows_tell_two_sources_apart},
    };
    int status = CHECK_MAIN(tests);
    unlink(file_path);
    return status;
}
