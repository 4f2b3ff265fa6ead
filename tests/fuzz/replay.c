/* Runs a fuzz target over every file of a corpus directory, over every cut of each file and over
 * each with single bytes changed: the corpus as an ordinary test. A second argument says at how
 * many places of a file, for targets that are slow. The same target links with libFuzzer
 * (-fsanitize=fuzzer) in place of this file. */
#include <dirent.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

#define FILE_MAX (64 * 1024)

/* A copy of exactly this size, so that a sanitizer sees the first byte beyond. */
static void run(const uint8_t *data, size_t size)
{
    uint8_t *copy = malloc(size ? size : 1);
    if (!copy)
        exit(1);
    memcpy(copy, data, size);
    LLVMFuzzerTestOneInput(copy, size);
    free(copy);
}

static void run_variants(uint8_t *data, size_t size, size_t places)
{
    size_t step = size > places ? size / places : 1;
    run(data, size);
    for (size_t cut = 0; cut < size; cut += step)
        run(data, cut);
    for (size_t at = 0; at < size; at += step) {
        static const uint8_t values[] = {0x00, 0x7f, 0x80, 0xff, '-', '9'};
        uint8_t was = data[at];
        for (size_t i = 0; i < sizeof(values); i++) {
            data[at] = values[i];
            run(data, size);
        }
        data[at] = was;
    }
}

int main(int argc, char **argv)
{
    static uint8_t data[FILE_MAX];
    DIR *dir = argc == 2 || argc == 3 ? opendir(argv[1]) : NULL;
    size_t places = argc == 3 ? strtoul(argv[2], NULL, 10) : 4096;
    if (!dir || places == 0) {
        fprintf(stderr, "usage: %s CORPUS [PLACES]\n", argv[0]);
        return 2;
    }
    unsigned files = 0;
    for (struct dirent *entry; (entry = readdir(dir));) {
        char path[4096];
        snprintf(path, sizeof(path), "%s/%s", argv[1], entry->d_name);
        FILE *file = entry->d_name[0] != '.' ? fopen(path, "rbe") : NULL;
        if (!file)
            continue;
        size_t size = fread(data, 1, sizeof(data), file);
        fclose(file);
        run_variants(data, size, places);
        files++;
    }
    closedir(dir);
    printf("%s: %u files\n", argv[1], files);
    return files > 0 ? 0 : 1; /* a corpus that was lost must not pass */
}
