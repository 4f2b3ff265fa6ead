/* terrain/data/earth.bin, inside the program. */
#include "terrain/planet_data.h"

__asm__(".section .rodata.planet, \"a\"\n"
        ".balign 16\n"
        ".hidden planet_data\n"
        ".global planet_data\n"
        "planet_data:\n"
        ".incbin \"" PLANET_FILE "\"\n"
        ".hidden planet_data_end\n"
        ".global planet_data_end\n"
        "planet_data_end:\n"
        ".byte 0\n"
        ".previous\n");
