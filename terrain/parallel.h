/* The same work on many items, on several threads. */
#pragma once

/* Called once for each item, from `worker` 0 .. jobs - 1 (one thread each). Returns 0 or -errno. */
typedef int (*parallel_function)(void *user, unsigned worker, unsigned item);

/* Runs `function` for items 0 .. count - 1 on up to `jobs` threads (one: the caller's own), and
 * waits. Returns 0 or the first failure, after which no further item is begun. */
int parallel_run(unsigned jobs, unsigned count, parallel_function function, void *user);
