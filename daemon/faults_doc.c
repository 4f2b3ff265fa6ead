/* Prints docs/faults.md from the table of faults; a build tool, not installed. */
#include <stdio.h>

#include "daemon/faults.h"

int main(void)
{
    size_t count;
    const struct fault_info *table = fault_table(&count);
    printf("# Faults\n\n"
           "Generated from `daemon/faults.def` by `ninja -C build faults-doc`; edit that file.\n\n"
           "A code stands in the log (`fault=`, in the journal `FAULT=`) and in Modbus input "
           "register 41,\nwhich shows the severest active fault, among equals the lowest code. "
           "Codes never change their meaning.\n\n"
           "* notice: the picture is as it should be\n"
           "* degraded: the picture is worse than it should be\n"
           "* severe: the picture is wrong or absent\n\n"
           "| code | name | severity | what raises it | what otwd does | what to do |\n"
           "|---|---|---|---|---|---|\n");
    for (size_t i = 0; i < count; i++)
        printf("| %d | %s | %s | %s | %s | %s |\n", table[i].code, table[i].name,
               fault_severity_name(table[i].severity), table[i].raised, table[i].response,
               table[i].action);
    return 0;
}
