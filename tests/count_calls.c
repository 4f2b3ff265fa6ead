/* Counts what the frame path must not do. To be preloaded (LD_PRELOAD) into a program: counts the
 * allocations and the locks of one thread that are asked for by the program's own code.
 *
 * A call counts where the calling thread has the name in COUNT_THREAD and the return address lies
 * in the text of the main program, into which all of our libraries are linked statically. What the
 * GL driver and other shared libraries do for themselves does not count: we cannot
 * help it. (A function of theirs that we call and that ends in a jump to free() looks like ours.)
 * Calls before COUNT_AFTER_S seconds count as early, later ones up to COUNT_UNTIL_S as late; at
 * exit the counts are written to COUNT_FILE, with the addresses of the late callers for
 * addr2line(1). */
#include <dlfcn.h>
#include <link.h>
#include <pthread.h>
#include <semaphore.h>
#include <stdatomic.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/prctl.h>

#include "base/clock.h"

#define EXPORT      __attribute__((visibility("default")))
#define CALLERS_MAX 16

/* glibc's own names of its allocator: no dlsym(), which allocates, is needed to reach them. */
void *__libc_malloc(size_t size);
void *__libc_calloc(size_t count, size_t size);
void *__libc_realloc(void *memory, size_t size);
void *__libc_memalign(size_t alignment, size_t size);
void __libc_free(void *memory);

enum kind { ALLOCATION, LOCK, KINDS };

static struct {
    uintptr_t base, text_start, text_end; /* of the main program */
    nsec_t late_ns, end_ns;
    char thread[16];
    _Atomic unsigned long early[KINDS], late[KINDS];
    struct { /* distinct ones; written by the counted thread alone */
        uintptr_t address;
        unsigned long calls;
    } callers[CALLERS_MAX];
} state;

/* The main program comes first. */
static int find_text(struct dl_phdr_info *info, size_t size, void *data)
{
    state.base = info->dlpi_addr;
    for (int i = 0; i < info->dlpi_phnum; i++) {
        const ElfW(Phdr) *header = &info->dlpi_phdr[i];
        if (header->p_type == PT_LOAD && (header->p_flags & PF_X)) {
            state.text_start = info->dlpi_addr + header->p_vaddr;
            state.text_end = state.text_start + header->p_memsz;
        }
    }
    return 1;
}

__attribute__((constructor)) static void begin(void)
{
    const char *thread = getenv("COUNT_THREAD"), *after = getenv("COUNT_AFTER_S");
    const char *until = getenv("COUNT_UNTIL_S");
    nsec_t start_ns = clock_monotonic_ns();
    snprintf(state.thread, sizeof(state.thread), "%s", thread ? thread : "");
    state.late_ns = start_ns + ns_from_seconds(after ? atof(after) : 0.0);
    state.end_ns = start_ns + ns_from_seconds(until ? atof(until) : 1e6);
    dl_iterate_phdr(find_text, NULL);
}

__attribute__((destructor)) static void end(void)
{
    const char *path = getenv("COUNT_FILE");
    FILE *out = path ? fopen(path, "w") : NULL;
    if (!out)
        return;
    fprintf(out, "early_allocations %lu\nearly_locks %lu\nlate_allocations %lu\nlate_locks %lu\n",
            state.early[ALLOCATION], state.early[LOCK], state.late[ALLOCATION], state.late[LOCK]);
    for (unsigned i = 0; i < CALLERS_MAX && state.callers[i].calls; i++)
        fprintf(out, "late_caller %#lx %lu\n", (unsigned long)state.callers[i].address,
                state.callers[i].calls);
    fclose(out);
}

static void note_caller(uintptr_t address)
{
    for (unsigned i = 0; i < CALLERS_MAX; i++) {
        if (state.callers[i].calls && state.callers[i].address != address)
            continue;
        state.callers[i].address = address;
        state.callers[i].calls++;
        return;
    }
}

static void count(enum kind kind, const void *return_address)
{
    uintptr_t caller = (uintptr_t)return_address;
    char name[16] = "";
    if (caller < state.text_start || caller >= state.text_end)
        return;
    prctl(PR_GET_NAME, name);
    if (strcmp(name, state.thread) != 0)
        return;
    nsec_t now_ns = clock_monotonic_ns();
    if (now_ns > state.end_ns)
        return;
    if (now_ns < state.late_ns) {
        atomic_fetch_add(&state.early[kind], 1);
        return;
    }
    atomic_fetch_add(&state.late[kind], 1);
    note_caller(caller - state.base);
}

#define COUNT(kind) count(kind, __builtin_return_address(0))

EXPORT void *malloc(size_t size)
{
    COUNT(ALLOCATION);
    return __libc_malloc(size);
}

EXPORT void *calloc(size_t number, size_t size)
{
    COUNT(ALLOCATION);
    return __libc_calloc(number, size);
}

EXPORT void *realloc(void *memory, size_t size)
{
    COUNT(ALLOCATION);
    return __libc_realloc(memory, size);
}

EXPORT void free(void *memory)
{
    COUNT(ALLOCATION);
    __libc_free(memory);
}

EXPORT void *aligned_alloc(size_t alignment, size_t size)
{
    COUNT(ALLOCATION);
    return __libc_memalign(alignment, size);
}

EXPORT int posix_memalign(void **ret_memory, size_t alignment, size_t size)
{
    COUNT(ALLOCATION);
    *ret_memory = __libc_memalign(alignment, size);
    return *ret_memory ? 0 : 12; /* ENOMEM */
}

/* operator new and delete of the C++ runtime, which would call malloc() from its own text. */
EXPORT void *new_(size_t size) __asm__("_Znwm");
EXPORT void *new_(size_t size)
{
    COUNT(ALLOCATION);
    void *memory = __libc_malloc(size ? size : 1);
    if (!memory)
        abort();
    return memory;
}

EXPORT void delete_(void *memory) __asm__("_ZdlPv");
EXPORT void delete_(void *memory)
{
    COUNT(ALLOCATION);
    __libc_free(memory);
}

EXPORT void delete_sized(void *memory, size_t size) __asm__("_ZdlPvm");
EXPORT void delete_sized(void *memory, size_t size)
{
    COUNT(ALLOCATION);
    __libc_free(memory);
}

#define NEXT(name)                                                                                 \
    static __typeof__(&name) next;                                                                 \
    if (!next)                                                                                     \
    next = (__typeof__(&name))dlsym(RTLD_NEXT, #name)

#define LOCKING(name, parameters, arguments)                                                       \
    EXPORT int name parameters                                                                     \
    {                                                                                              \
        NEXT(name);                                                                                \
        COUNT(LOCK);                                                                               \
        return next arguments;                                                                     \
    }

LOCKING(pthread_mutex_lock, (pthread_mutex_t * mutex), (mutex))
LOCKING(pthread_mutex_trylock, (pthread_mutex_t * mutex), (mutex))
LOCKING(pthread_rwlock_rdlock, (pthread_rwlock_t * lock), (lock))
LOCKING(pthread_rwlock_wrlock, (pthread_rwlock_t * lock), (lock))
LOCKING(pthread_cond_wait, (pthread_cond_t * condition, pthread_mutex_t *mutex), (condition, mutex))
LOCKING(pthread_cond_timedwait,
        (pthread_cond_t * condition, pthread_mutex_t *mutex, const struct timespec *until),
        (condition, mutex, until))
LOCKING(pthread_cond_signal, (pthread_cond_t * condition), (condition))
LOCKING(pthread_cond_broadcast, (pthread_cond_t * condition), (condition))
LOCKING(sem_wait, (sem_t * semaphore), (semaphore))
LOCKING(sem_timedwait, (sem_t * semaphore, const struct timespec *until), (semaphore, until))
