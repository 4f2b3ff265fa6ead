/* The checks of a CAN source's keys. Private to config/. */
#pragma once

#include "config/document.h"

/* Checks the table `fields` of a source of type can-table, whose mapping is `node`, and settles
 * each field's identifier; `index` is the source's, for sentences. */
void document_check_can_table(struct document *document, yaml_node_t *node, unsigned index,
                              struct config_source *source);
