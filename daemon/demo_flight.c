#include "daemon/demo_flight.h"

__asm__(".section .rodata.demo_flight, \"a\"\n"
        ".hidden demo_flight_csv\n"
        ".global demo_flight_csv\n"
        "demo_flight_csv:\n"
        ".incbin \"" DEMO_FLIGHT_FILE "\"\n"
        ".hidden demo_flight_csv_end\n"
        ".global demo_flight_csv_end\n"
        "demo_flight_csv_end:\n"
        ".byte 0\n"
        ".previous\n");
