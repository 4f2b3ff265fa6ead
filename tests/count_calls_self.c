/* A program whose calls are known, to prove that count_calls.c counts: in a thread named "counted"
 * 2 allocating calls early; late 3 + 2 + 1 allocations, 6 frees and 5 locks; and the same amount
 * in a thread of another name, which must not count. */
#include <pthread.h>
#include <semaphore.h>
#include <stdlib.h>

#include "base/clock.h"

static void *volatile kept[6]; /* volatile: the compiler may not do without the memory */
static pthread_mutex_t lock = PTHREAD_MUTEX_INITIALIZER;

static void work(void)
{
    for (int i = 0; i < 3; i++)
        kept[i] = malloc(100);
    for (int i = 3; i < 5; i++)
        kept[i] = calloc(10, 10);
    kept[5] = realloc(NULL, 100);
    for (int i = 0; i < 6; i++)
        free(kept[i]);
    for (int i = 0; i < 4; i++) {
        pthread_mutex_lock(&lock);
        pthread_mutex_unlock(&lock);
    }
    sem_t semaphore;
    sem_init(&semaphore, 0, 1);
    sem_wait(&semaphore);
    sem_destroy(&semaphore);
}

static void *thread_main(void *data)
{
    pthread_setname_np(pthread_self(), data);
    kept[0] = malloc(1);
    free(kept[0]);
    clock_sleep_until(clock_monotonic_ns() + NSEC_PER_SEC);
    work();
    return NULL;
}

int main(void)
{
    static char counted[] = "counted", other[] = "other";
    pthread_t thread;
    char *names[] = {counted, other};
    for (int i = 0; i < 2; i++) {
        if (pthread_create(&thread, NULL, thread_main, names[i]) != 0)
            return 1;
        pthread_join(thread, NULL);
    }
    return 0;
}
