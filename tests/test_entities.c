/* Which shape and size an entity of a host is drawn in. */
#include "daemon/entities.h"
#include "tests/check.h"

static const struct config_entity list[] = {
    {.type = 20, .shape = CONFIG_SHAPE_VEHICLE, .length_m = 9, .width_m = 3, .height_m = 2},
    {.type = 225, .shape = CONFIG_SHAPE_AIRCRAFT, .length_m = 70, .width_m = 60, .height_m = 19},
};
static const struct entity_types types = {list, 2};

static struct render_entity drawn(struct traffic_entity seen)
{
    static struct traffic traffic;
    struct render_entity entity;
    traffic.count = 1;
    traffic.list[0] = seen;
    entities_from_traffic(&traffic, &types, 0, &entity);
    return entity;
}

static void a_type_of_the_list_has_its_shape_and_size(void)
{
    struct render_entity entity = drawn((struct traffic_entity){
        .type = 20, .alpha = 51, .ecef_m = {1, 2, 3}, .ecef_from_body = {0.5, 0.5, 0.5, -0.5}});
    CHECK_INT(entity.shape, ENTITY_BOX);
    CHECK_NEAR((double)entity.length_m, 9, 0);
    CHECK_NEAR((double)entity.width_m, 3, 0);
    CHECK_NEAR((double)entity.height_m, 2, 0);
    CHECK_NEAR((double)entity.alpha, 0.2, 1e-6);
    CHECK(entity.ecef_m[0] == 1 && entity.ecef_m[1] == 2 && entity.ecef_m[2] == 3);
    CHECK(entity.ecef_from_body.w == 0.5 && entity.ecef_from_body.z == -0.5);
    CHECK_INT(drawn((struct traffic_entity){.type = 225}).shape, ENTITY_ARROW);
}

static void an_unknown_type_is_an_aircraft_of_15_m(void)
{
    struct render_entity entity = drawn((struct traffic_entity){.type = 21, .alpha = 255});
    CHECK_INT(entity.shape, ENTITY_ARROW);
    CHECK_NEAR((double)entity.length_m, 15, 0);
    CHECK_NEAR((double)entity.alpha, 1, 0);
}

/* The thread that draws may have missed the frame that it was placed for, but not by much. */
static void one_that_was_placed_for_another_frame_is_carried_on(void)
{
    static struct traffic traffic = {
        .time_ns = NSEC_PER_SEC,
        .count = 1,
        .list = {{.ecef_m = {1000, 2000, 3000}, .ecef_mps = {200, -100, 0}}}};
    static const struct {
        int ms;
        double x_m, y_m;
    } known[] = {{0, 1000, 2000}, {17, 1003.4, 1998.3}, {-17, 996.6, 2001.7}, {900, 1020, 1990}};
    for (int i = 0; i < 4; i++) {
        struct render_entity entity;
        entities_from_traffic(&traffic, &types, NSEC_PER_SEC + known[i].ms * NSEC_PER_MSEC,
                              &entity);
        CHECK_NEAR(entity.ecef_m[0], known[i].x_m, 1e-9);
        CHECK_NEAR(entity.ecef_m[1], known[i].y_m, 1e-9);
        CHECK_NEAR(entity.ecef_m[2], 3000, 0);
    }
}

/* Whatever the list has for a number that is the country's. */
static void a_dis_enumeration_goes_by_its_domain(void)
{
    struct render_entity land =
        drawn((struct traffic_entity){.type = 225, .enumerated = true, .domain = 1});
    struct render_entity air =
        drawn((struct traffic_entity){.type = 20, .enumerated = true, .domain = 2});
    CHECK_INT(land.shape, ENTITY_BOX);
    CHECK_NEAR((double)land.length_m, 6, 0);
    CHECK_INT(air.shape, ENTITY_ARROW);
    CHECK_NEAR((double)air.length_m, 15, 0);
}

int main(void)
{
    static const struct check_test tests[] = {
        {"a type of the list has its shape and size", a_type_of_the_list_has_its_shape_and_size},
        {"an unknown type is an aircraft of 15 m", an_unknown_type_is_an_aircraft_of_15_m},
        {"one that was placed for another frame is carried on",
         one_that_was_placed_for_another_frame_is_carried_on},
        {"a DIS enumeration goes by its domain", a_dis_enumeration_goes_by_its_domain},
    };
    return CHECK_MAIN(tests);
}
