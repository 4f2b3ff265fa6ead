/* Linked programs in the driver's own form, kept from run to run: with some drivers compiling them
 * is most of the start.
 *
 * A directory with a file a program, named by a hash of all that the program depends on: the
 * driver's vendor, renderer and version, and the text of every stage. A file that is damaged, or
 * that the driver refuses, is as good as none; the program is then compiled and the file written
 * anew. Of more than PROGRAM_CACHE_FILES the oldest go. Drivers without binary formats have no use
 * for it. */
#pragma once

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define PROGRAM_CACHE_FILES 64

/* From now on all programs of this process are looked for and put there; NULL, as at the start:
 * nowhere. The directory is copied, and made when it is needed. Not while programs are created. */
void program_cache_use(const char *directory);

/* Of texts in this order, for the current context. */
uint64_t program_cache_key(const char *const *texts, size_t count);

/* Makes `program`, a new program object, the one of that key. False where there is none: the object
 * is then good for nothing but its deletion. Current context. */
bool program_cache_load(uint64_t key, unsigned program);

/* Keeps a program that was linked with GL_PROGRAM_BINARY_RETRIEVABLE_HINT. Where that fails, say on
 * a full disk, there is none. */
void program_cache_store(uint64_t key, unsigned program);
