/* Programs that are kept from run to run: that they are taken, and what is not taken. */
#include <dirent.h>
#include <ftw.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/time.h>
#include <unistd.h>

#include "render/program.h"
#include "render/program_cache.h"
#include "tests/count_gl.h"
#include "tests/render_fixture.h"

static char scratch[64], directory[96];

static const struct program_params select_program = {
    .name = "select",
    .defines = "#define BLOCK 8\n#define TABLE 32\n#define DRAWS 1\n#define BLOCKS_A_DRAW 64\n"
               "#define SPLIT 1\n",
    .shared = {"blocks.glsl"}};
static const struct program_params other_program = {
    .name = "select",
    .defines = "#define BLOCK 8\n#define TABLE 32\n#define DRAWS 1\n#define BLOCKS_A_DRAW 64\n"
               "#define SPLIT 0\n",
    .shared = {"blocks.glsl"}};

static int remove_one(const char *path, const struct stat *status, int kind, struct FTW *walk)
{
    (void)status, (void)kind, (void)walk;
    return remove(path);
}

static void forget(void)
{
    nftw(directory, remove_one, 8, FTW_DEPTH | FTW_PHYS);
}

/* The only file, or the last; their number. */
static int find_file(char path[512])
{
    int count = 0;
    DIR *files = opendir(directory);
    for (struct dirent *entry; files && (entry = readdir(files));)
        if (entry->d_name[0] != '.') {
            snprintf(path, 512, "%s/%.200s", directory, entry->d_name);
            count++;
        }
    if (files)
        closedir(files);
    return count;
}

/* Makes a program and deletes it. True where it was compiled. */
static bool is_compiled(const struct program_params *params)
{
    GLuint program = 0;
    struct diag diag = {""};
    unsigned before = count_gl_calls;
    if (program_create(params, &program, &diag) < 0)
        CHECK_FAIL("%s", diag.text);
    GLint linked = 0;
    glGetProgramiv(program, GL_LINK_STATUS, &linked);
    CHECK(linked);
    CHECK(glGetError() == GL_NO_ERROR);
    bool compiled = strcmp(count_gl_last, "glLinkProgram") == 0;
    CHECK(count_gl_calls > before);
    glDeleteProgram(program);
    return compiled;
}

static void a_program_is_compiled_once(void)
{
    char path[512];
    forget();
    CHECK(is_compiled(&select_program)); /* and the directory is made */
    CHECK_INT(find_file(path), 1);
    CHECK(!is_compiled(&select_program));
    CHECK(is_compiled(&other_program)); /* other defines */
    CHECK(!is_compiled(&other_program));
    CHECK(!is_compiled(&select_program));
    CHECK_INT(find_file(path), 2);
}

static void what_has_no_directory_is_compiled(void)
{
    forget();
    program_cache_use(NULL);
    CHECK(is_compiled(&select_program));
    CHECK(is_compiled(&select_program));
    program_cache_use("/proc/nowhere");
    CHECK(is_compiled(&select_program));
    CHECK(is_compiled(&select_program));
    program_cache_use(directory);
}

static void write_at(const char *path, long offset, int byte)
{
    FILE *file = fopen(path, "r+b");
    if (!file || fseek(file, offset, offset < 0 ? SEEK_END : SEEK_SET) < 0)
        CHECK_FAIL("%s", path);
    int was = fgetc(file);
    fseek(file, -1, SEEK_CUR);
    fputc(byte < 0 ? was ^ 0x10 : byte, file);
    fclose(file);
}

static void a_damaged_file_is_made_anew(void)
{
    static const long flipped[] = {0, 8, 16, 24, 28, 32, 100, -1};
    char path[512], other[512];
    struct stat status;
    for (size_t i = 0; i < sizeof(flipped) / sizeof(flipped[0]); i++) {
        forget();
        is_compiled(&select_program);
        find_file(path);
        write_at(path, flipped[i], -1);
        CHECK(is_compiled(&select_program));
        CHECK(!is_compiled(&select_program));
    }
    stat(path, &status);
    for (long bytes = 0; bytes < status.st_size; bytes += 1 + bytes / 2) {
        CHECK(truncate(path, bytes) == 0);
        CHECK(is_compiled(&select_program));
    }
    write_at(path, status.st_size, 'x'); /* and one that is too long */
    CHECK(truncate(path, status.st_size + 1) == 0);
    CHECK(is_compiled(&select_program));
    /* Another program's file by this one's name. */
    forget();
    is_compiled(&other_program);
    CHECK_INT(find_file(other), 1);
    CHECK(rename(other, path) == 0);
    CHECK(is_compiled(&select_program));
}

/* Whole by its sum, but the driver makes nothing of it. */
static void what_the_driver_refuses_is_compiled(void)
{
    struct {
        char magic[8];
        uint64_t key, sum;
        uint32_t format, bytes;
        char binary[64];
    } file;
    char path[512];
    forget();
    is_compiled(&select_program);
    find_file(path);
    FILE *in = fopen(path, "rb");
    CHECK(in && fread(&file, 1, sizeof(file), in) == sizeof(file));
    fclose(in);
    for (int format = 0; format < 2; format++) {
        memset(file.binary, 0x5a, sizeof(file.binary));
        file.bytes = sizeof(file.binary);
        file.format ^= format ? 0xffff : 0; /* none of the driver's */
        file.sum = 0xcbf29ce484222325;
        for (size_t i = 0; i < sizeof(file.binary); i++)
            file.sum = (file.sum ^ (unsigned char)file.binary[i]) * 0x100000001b3;
        FILE *out = fopen(path, "wb");
        CHECK(out && fwrite(&file, 1, sizeof(file), out) == sizeof(file));
        fclose(out);
        CHECK(is_compiled(&select_program));
        CHECK(!is_compiled(&select_program));
    }
}

static void the_oldest_file_goes(void)
{
    char path[512], first[512];
    const struct timeval old[2] = {{.tv_sec = 1000}, {.tv_sec = 1000}};
    forget();
    is_compiled(&select_program);
    find_file(first);
    for (int i = 1; i < PROGRAM_CACHE_FILES; i++) {
        snprintf(path, sizeof(path), "%s/%d", directory, i);
        FILE *file = fopen(path, "wb");
        CHECK(file);
        fclose(file);
        utimes(path, old);
    }
    CHECK_INT(find_file(path), PROGRAM_CACHE_FILES);
    is_compiled(&other_program);
    CHECK_INT(find_file(path), PROGRAM_CACHE_FILES);
    CHECK(access(first, F_OK) == 0);
    CHECK(!is_compiled(&other_program));
}

static PFNGLLINKPROGRAMPROC link_program;
static int links;

static void GLAPIENTRY count_link(GLuint program)
{
    links++;
    link_program(program);
}

/* What was kept draws the same picture; no program of the second renderer is compiled. */
static void a_kept_program_draws_the_same(void)
{
    static uint32_t pictures[2][WIDTH * HEIGHT];
    forget();
    link_program = epoxy_glLinkProgram;
    epoxy_glLinkProgram = count_link;
    for (int i = 0; i < 2; i++) {
        struct scene_under_test scene = {0};
        links = 0;
        if (!open_scene(flat_ground, 32, NULL, &scene))
            return;
        CHECK((links > 0) == (i == 0));
        struct view view = view_at(46.5, 8.0, 300.0, 30.0, -5.0, 0.0);
        draw(&scene, &view, NULL, pictures[i], NULL);
        close_scene(&scene);
    }
    epoxy_glLinkProgram = link_program;
    CHECK(memcmp(pictures[0], pictures[1], sizeof(pictures[0])) == 0);
}

static int run_tests(const struct check_test *tests, size_t count)
{
    GLint formats = 0;
    glGetIntegerv(GL_NUM_PROGRAM_BINARY_FORMATS, &formats);
    if (formats > 0)
        return check_main(tests, count);
    printf("skipped: the driver gives no programs away\n");
    return 77;
}

int main(void)
{
    static const struct check_test tests[] = {
        {"a program is compiled once", a_program_is_compiled_once},
        {"what has no directory is compiled", what_has_no_directory_is_compiled},
        {"a damaged file is made anew", a_damaged_file_is_made_anew},
        {"what the driver refuses is compiled", what_the_driver_refuses_is_compiled},
        {"the oldest file goes", the_oldest_file_goes},
        {"a kept program draws the same", a_kept_program_draws_the_same},
    };
    snprintf(scratch, sizeof(scratch), "/tmp/otwd-programs-XXXXXX");
    if (!mkdtemp(scratch))
        return 1;
    snprintf(directory, sizeof(directory), "%s/a/programs", scratch);
    program_cache_use(directory);
    count_gl_start();
    int status = render_tests_main(tests, sizeof(tests) / sizeof(tests[0]), run_tests);
    nftw(scratch, remove_one, 8, FTW_DEPTH | FTW_PHYS);
    return status;
}
