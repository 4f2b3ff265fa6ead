#include "daemon/faults.h"
#include "tests/check.h"

static void codes_rise_and_every_row_is_complete(void)
{
    size_t count;
    const struct fault_info *table = fault_table(&count);
    CHECK(count > 10);
    for (size_t i = 0; i < count; i++) {
        if (table[i].code < 101 || table[i].code > 999 ||
            (i > 0 && table[i].code <= table[i - 1].code))
            CHECK_FAIL("code %d stands out of order", table[i].code);
        CHECK(*table[i].name && *table[i].raised && *table[i].response && *table[i].action);
        CHECK(fault_find(table[i].code) == &table[i]);
    }
    CHECK(!fault_find(0));
    CHECK(!fault_find(65535));
}

static void published_codes_keep_their_meaning(void)
{
    CHECK_INT(FAULT_POSE_NONE, 101);
    CHECK_INT(FAULT_POSE_STALE, 102);
    CHECK_INT(FAULT_TERRAIN_READ_ERROR, 201);
    CHECK_INT(FAULT_DEADLINE_MISSED, 301);
    CHECK_INT(FAULT_MODBUS_FAILED, 401);
    CHECK_INT(FAULT_RECORDER_FAILED, 501);
}

static void the_worst_fault_is_the_severest_then_the_first(void)
{
    struct fault_set set = {0};
    CHECK_INT(fault_worst(&set), FAULT_NONE);
    CHECK(fault_raise(&set, FAULT_POSE_REJECTED));
    CHECK(!fault_raise(&set, FAULT_POSE_REJECTED));
    CHECK_INT(fault_worst(&set), FAULT_POSE_REJECTED);
    fault_raise(&set, FAULT_DEADLINE_MISSED);
    CHECK_INT(fault_worst(&set), FAULT_DEADLINE_MISSED);
    fault_raise(&set, FAULT_RENDERER_FAILED);
    fault_raise(&set, FAULT_CAN_BUS_OFF);
    CHECK_INT(fault_worst(&set), FAULT_CAN_BUS_OFF);
    CHECK(fault_clear(&set, FAULT_CAN_BUS_OFF));
    CHECK(!fault_clear(&set, FAULT_CAN_BUS_OFF));
    CHECK(!fault_is_active(&set, FAULT_CAN_BUS_OFF));
    CHECK(fault_is_active(&set, FAULT_RENDERER_FAILED));
    CHECK_INT(fault_worst(&set), FAULT_RENDERER_FAILED);
}

int main(void)
{
    static const struct check_test tests[] = {
        {"codes rise and every row is complete", codes_rise_and_every_row_is_complete},
        {"published codes keep their meaning", published_codes_keep_their_meaning},
        {"the worst fault is the severest, then the first",
         the_worst_fault_is_the_severest_then_the_first},
    };
    return CHECK_MAIN(tests);
}
