/* Preloaded into programs built with a sanitizer: Mesa's drivers stay loaded, so that what they
 * hold to the end is reachable, and has a name in a report. */
__attribute__((visibility("default"))) int dlclose(void *handle);

int dlclose(void *handle)
{
    (void)handle;
    return 0;
}
