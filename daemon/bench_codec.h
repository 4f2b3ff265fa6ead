/* `otwd bench codec`, which otwd-import does: rasters are GDAL's to read. */
#pragma once

int bench_codec_main(int argc, char **argv);
