#include "render/program_cache.h"

#include <dirent.h>
#include <epoxy/gl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/cache.h"

#define MAGIC     "otwdprg1"
#define BYTES_MAX (64 << 20)
#define PATH_ROOM 3200

/* What a file begins with; the driver's bytes follow. */
struct header {
    char magic[8];
    uint64_t key, sum; /* sum: of the driver's bytes */
    uint32_t format, bytes;
};

static char directory[PATH_ROOM - 64]; /* "": nowhere */

/* FNV-1a, 64 bits (Fowler, Noll, Vo; RFC 9923). */
static uint64_t hash_on(uint64_t hash, const void *bytes, size_t size)
{
    const unsigned char *at = bytes;
    for (size_t i = 0; i < size; i++)
        hash = (hash ^ at[i]) * 0x100000001b3;
    return hash;
}

static uint64_t hash_of(const void *bytes, size_t size)
{
    return hash_on(0xcbf29ce484222325, bytes, size);
}

void program_cache_use(const char *path)
{
    int written = snprintf(directory, sizeof(directory), "%s", path ? path : "");
    if (written >= (int)sizeof(directory))
        directory[0] = '\0';
}

uint64_t program_cache_key(const char *const *texts, size_t count)
{
    static const GLenum names[] = {GL_VENDOR, GL_RENDERER, GL_VERSION};
    uint64_t hash = hash_of("", 0);
    for (size_t i = 0; i < sizeof(names) / sizeof(names[0]); i++) {
        const char *text = (const char *)glGetString(names[i]);
        hash = hash_on(hash, text, strlen(text) + 1); /* the zero keeps texts apart */
    }
    for (size_t i = 0; i < count; i++)
        hash = hash_on(hash, texts[i], strlen(texts[i]) + 1);
    return hash;
}

static void path_of(uint64_t key, char path[PATH_ROOM])
{
    snprintf(path, PATH_ROOM, "%s/%016llx.program", directory, (unsigned long long)key);
}

static bool is_format(GLenum format)
{
    GLint count = 0, formats[32];
    glGetIntegerv(GL_NUM_PROGRAM_BINARY_FORMATS, &count);
    if (count <= 0 || count > (GLint)(sizeof(formats) / sizeof(formats[0])))
        return false;
    glGetIntegerv(GL_PROGRAM_BINARY_FORMATS, formats);
    for (GLint i = 0; i < count; i++)
        if ((GLenum)formats[i] == format)
            return true;
    return false;
}

/* The driver's bytes of a whole file, to be freed; NULL where it is not what it should be. */
static void *read_program(FILE *file, uint64_t key, struct header *ret_header)
{
    struct header header;
    if (fread(&header, sizeof(header), 1, file) != 1 || header.key != key ||
        memcmp(header.magic, MAGIC, sizeof(header.magic)) != 0 || header.bytes > BYTES_MAX)
        return NULL;
    char *bytes = malloc(header.bytes + 1);
    if (bytes && (fread(bytes, 1, header.bytes + 1, file) != header.bytes ||
                  hash_of(bytes, header.bytes) != header.sum)) {
        free(bytes);
        bytes = NULL;
    }
    *ret_header = header;
    return bytes;
}

bool program_cache_load(uint64_t key, unsigned program)
{
    char path[PATH_ROOM];
    struct header header;
    GLint linked = 0;
    path_of(key, path);
    FILE *file = directory[0] ? fopen(path, "rbe") : NULL;
    if (!file)
        return false;
    void *bytes = read_program(file, key, &header);
    fclose(file);
    if (bytes && is_format(header.format)) {
        glProgramBinary(program, header.format, bytes, (GLsizei)header.bytes);
        glGetProgramiv(program, GL_LINK_STATUS, &linked);
    }
    free(bytes);
    return linked;
}

/* Removes the oldest file where there are too many: those of old drivers, or of runs that ended
 * while they wrote. */
static void remove_oldest(void)
{
    char path[PATH_ROOM], oldest[PATH_ROOM] = "";
    struct stat status;
    time_t oldest_s = 0;
    int count = 0;
    DIR *files = opendir(directory);
    for (struct dirent *entry; files && (entry = readdir(files));) {
        int written = snprintf(path, sizeof(path), "%s/%s", directory, entry->d_name);
        if (written >= (int)sizeof(path) || stat(path, &status) < 0 || !S_ISREG(status.st_mode))
            continue;
        if (count++ == 0 || status.st_mtime < oldest_s) {
            oldest_s = status.st_mtime;
            memcpy(oldest, path, sizeof(path));
        }
    }
    if (files)
        closedir(files);
    if (count > PROGRAM_CACHE_FILES)
        unlink(oldest);
}

void program_cache_store(uint64_t key, unsigned program)
{
    char path[PATH_ROOM];
    GLint bytes = 0;
    GLsizei length = 0;
    GLenum format = 0;
    if (!directory[0])
        return;
    glGetProgramiv(program, GL_PROGRAM_BINARY_LENGTH, &bytes);
    if (bytes <= 0 || bytes > BYTES_MAX)
        return;
    char *file = malloc(sizeof(struct header) + (size_t)bytes), *binary = file;
    if (!file)
        return;
    binary += sizeof(struct header);
    glGetProgramBinary(program, bytes, &length, &format, binary);
    struct header header = {.magic = MAGIC,
                            .key = key,
                            .sum = hash_of(binary, (size_t)length),
                            .format = format,
                            .bytes = (uint32_t)length};
    memcpy(file, &header, sizeof(header));
    path_of(key, path);
    if (length > 0 && cache_make_directories(directory, NULL) == 0 &&
        cache_write(path, file, sizeof(header) + (size_t)length, NULL) == 0)
        remove_oldest();
    free(file);
}
