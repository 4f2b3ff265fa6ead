#include "daemon/html.h"

#include <errno.h>
#include <math.h>
#include <stdbool.h>

static const char style[] =
    "</title>\n"
    "<style>body{font:15px/1.5 system-ui,sans-serif;margin:2rem auto;max-width:1040px;padding:0 "
    "1rem;color:#1c2733}h1{font-size:1.5rem}h2{font-size:1.1rem;margin-top:2rem}table{border-"
    "collapse:collapse}td,th{padding:.25rem .8rem;border-bottom:1px solid #d8dee4;text-align:right}"
    "td:first-child,th:first-child{text-align:left}svg{width:100%;height:auto;background:#f6f8fa}"
    "text{font:12px system-ui,sans-serif;fill:#57606a}figure{margin:0;display:inline-block;width:"
    "49%}img{width:100%}figcaption{font-size:.85rem;color:#57606a}</style></head><body>\n<h1>";

void html_begin(FILE *file, const char *title)
{
    fputs("<!doctype html><html lang=\"en\"><head><meta charset=\"utf-8\"><title>", file);
    html_text(file, title);
    fputs(style, file);
    html_text(file, title);
    fputs("</h1>\n", file);
}

int html_end(FILE *file)
{
    fputs("</body></html>\n", file);
    bool failed = ferror(file);
    if (fclose(file) != 0 || failed)
        return errno ? -errno : -EIO;
    return 0;
}

#define LABEL_ABOVE 16
#define LABEL_BELOW 22

void html_plot_begin(FILE *file, int width, int height)
{
    fprintf(file, "<svg viewBox=\"0 %d %d %d\">\n", -LABEL_ABOVE, width,
            LABEL_ABOVE + height + LABEL_BELOW);
}

void html_text(FILE *file, const char *text)
{
    for (; *text; text++) {
        switch (*text) {
        case '<':
            fputs("&lt;", file);
            break;
        case '>':
            fputs("&gt;", file);
            break;
        case '&':
            fputs("&amp;", file);
            break;
        case '"':
            fputs("&quot;", file);
            break;
        default:
            fputc(*text, file);
        }
    }
}

double html_nice_above(double value)
{
    double unit = pow(10.0, floor(log10(fmax(value, 1e-3))));
    static const double steps[] = {1.0, 2.0, 2.5, 5.0, 10.0};
    for (size_t i = 0; i < sizeof(steps) / sizeof(steps[0]); i++)
        if (steps[i] * unit >= value)
            return steps[i] * unit;
    return 10.0 * unit;
}
