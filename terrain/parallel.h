/* The same work on many items, on several threads. */
#pragma once

/* Processors that this process may run on (cgroups apart): at least 1. */
unsigned parallel_processors(void);

/* Called once for each item, from `worker` 0 .. jobs - 1 (one thread each). Returns 0 or -errno. */
typedef int (*parallel_function)(void *user, unsigned worker, unsigned item);

/* Runs `function` for items 0 .. count - 1 on up to `jobs` threads (one: the caller's own), and
 * waits. Returns 0 or the first failure, after which no further item is begun. */
int parallel_run(unsigned jobs, unsigned count, parallel_function function, void *user);

/* Threads that stay, for work that comes again and again and is short. */
struct crew;

/* `jobs` counts the thread that calls crew_run; the others, named `name` (at most 15 characters),
 * sleep until there is work. Fewer threads than asked for are no failure. Returns 0 or -ENOMEM. */
int crew_create(unsigned jobs, const char *name, struct crew **ret_crew);
/* Legal on NULL. No crew_run may be under way. */
void crew_destroy(struct crew *crew);
/* How many workers there are: `worker` is less than that. */
unsigned crew_size(const struct crew *crew);
/* As parallel_run. One thread at a time. */
int crew_run(struct crew *crew, unsigned count, parallel_function function, void *user);
