/* The flight that `otwd demo` flies: daemon/demo_flight.csv, inside the program. */
#pragma once

extern const char demo_flight_csv[], demo_flight_csv_end[];
