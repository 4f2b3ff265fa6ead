/* The list of entity types: sizes that are not given, and what is wrong with it. */
#include "tests/config_fixture.h"

static void entities_have_a_size_in_proportion(void)
{
    struct config c;
    struct config_errors errors;
    CHECK_INT(load("entities:\n"
                   "- {type: 7}\n"
                   "- {type: 8, shape: vehicle, length_m: 12}\n"
                   "- {type: 0, length_m: 30, width_m: 40, height_m: 11}\n",
                   &c, &errors),
              0);
    CHECK_INT(c.entities_count, 3);
    const struct config_entity expected[3] = {{7, CONFIG_SHAPE_AIRCRAFT, 15, 12, 4},
                                              {8, CONFIG_SHAPE_VEHICLE, 12, 5, 5},
                                              {0, CONFIG_SHAPE_AIRCRAFT, 30, 40, 11}};
    for (int i = 0; i < 3; i++) {
        CHECK_INT(c.entities[i].type, expected[i].type);
        CHECK_INT(c.entities[i].shape, expected[i].shape);
        CHECK_NEAR(c.entities[i].length_m, expected[i].length_m, 1e-9);
        CHECK_NEAR(c.entities[i].width_m, expected[i].width_m, 1e-9);
        CHECK_NEAR(c.entities[i].height_m, expected[i].height_m, 1e-9);
    }
    config_finish(&c);
    config_errors_finish(&errors);
}

static void wrong_entities_are_named_at_their_place(void)
{
    static const struct bad bad[] = {
        {"entities:\n- {shape: vehicle}\n", "2:3: entities[0].type is missing"},
        {"entities:\n- {type: 1}\n- {type: 2}\n- {type: 1}\n",
         "4:10: entities[2].type: entities[0] is already 1"},
        {"entities:\n- {type: 1, shape: boat}\n",
         "2:20: entities[0].shape is 'boat'; it must be one of aircraft, vehicle"},
        {"entities:\n- {type: 1, length_m: 0}\n",
         "2:23: entities[0].length_m is 0; it must lie between 0.1 and 500 m"},
        {"entities:\n- {type: 65536}\n",
         "2:10: entities[0].type is 65536; it must lie between 0 and 65535"},
    };
    check_bad(bad, sizeof(bad) / sizeof(bad[0]));
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
        {"entities have a size in proportion", entities_have_a_size_in_proportion},
        {"wrong entities are named at their place", wrong_entities_are_named_at_their_place},
    };
    int status = CHECK_MAIN(tests);
    unlink(file_path);
    return status;
}
