/* Which shape and size an entity of a host is drawn in. */
#include "daemon/entities.h"
#include "tests/check.h"

static const struct config_entity list[] = {
    {.type = 20, .shape = CONFIG_SHAPE_VEHICLE, .length_m = 9, .width_m = 3, .height_m = 2},
    {.type = 225, .shape = CONFIG_SHAPE_AIRCRAFT, .length_m = 70, .width_m = 60, .height_m = 19},
};
static const struct entity_types types = {list, 2};

static struct render_entity drawn(struct cigi_seen seen)
{
    static struct traffic traffic;
    struct render_entity entity;
    traffic.count = 1;
    traffic.list[0] = seen;
    entities_from_traffic(&traffic, &types, &entity);
    return entity;
}

static void a_type_of_the_list_has_its_shape_and_size(void)
{
    struct render_entity entity = drawn((struct cigi_seen){
        .type = 20, .alpha = 51, .ecef_m = {1, 2, 3}, .ecef_from_body = {0.5, 0.5, 0.5, -0.5}});
    CHECK_INT(entity.shape, ENTITY_BOX);
    CHECK_NEAR((double)entity.length_m, 9, 0);
    CHECK_NEAR((double)entity.width_m, 3, 0);
    CHECK_NEAR((double)entity.height_m, 2, 0);
    CHECK_NEAR((double)entity.alpha, 0.2, 1e-6);
    CHECK(entity.ecef_m[0] == 1 && entity.ecef_m[1] == 2 && entity.ecef_m[2] == 3);
    CHECK(entity.ecef_from_body.w == 0.5 && entity.ecef_from_body.z == -0.5);
    CHECK_INT(drawn((struct cigi_seen){.type = 225}).shape, ENTITY_ARROW);
}

static void an_unknown_type_is_an_aircraft_of_15_m(void)
{
    struct render_entity entity = drawn((struct cigi_seen){.type = 21, .alpha = 255});
    CHECK_INT(entity.shape, ENTITY_ARROW);
    CHECK_NEAR((double)entity.length_m, 15, 0);
    CHECK_NEAR((double)entity.alpha, 1, 0);
}

/* Whatever the list has for a number that is the country's. */
static void a_dis_enumeration_goes_by_its_domain(void)
{
    struct render_entity land =
        drawn((struct cigi_seen){.type = 225, .enumerated = true, .domain = 1});
    struct render_entity air =
        drawn((struct cigi_seen){.type = 20, .enumerated = true, .domain = 2});
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
        {"a DIS enumeration goes by its domain", a_dis_enumeration_goes_by_its_domain},
    };
    return CHECK_MAIN(tests);
}
