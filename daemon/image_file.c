#include "daemon/image_file.h"

#include <errno.h>
#include <png.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <tiffio.h>

#define PNG_LEVEL           3 /* zlib: a third of the time of the default for 5 % more bytes */
#define TIFFTAG_GDAL_META   42112
#define TIFFTAG_GDAL_NODATA 42113

static int write_rows(png_structp png, png_infop info, FILE *file, int width, int height,
                      const uint8_t *rgba)
{
    if (setjmp(png_jmpbuf(png)))
        return -EIO;
    png_init_io(png, file);
    png_set_compression_level(png, PNG_LEVEL);
    png_set_filter(png, PNG_FILTER_TYPE_BASE, PNG_FILTER_SUB);
    png_set_IHDR(png, info, (png_uint_32)width, (png_uint_32)height, 8, PNG_COLOR_TYPE_RGB,
                 PNG_INTERLACE_NONE, PNG_COMPRESSION_TYPE_DEFAULT, PNG_FILTER_TYPE_DEFAULT);
    png_write_info(png, info);
    png_set_filler(png, 0, PNG_FILLER_AFTER);
    for (int row = height - 1; row >= 0; row--)
        png_write_row(png, rgba + (size_t)row * (size_t)width * 4);
    png_write_end(png, NULL);
    return 0;
}

int image_write_png(const char *path, int width, int height, const uint8_t *rgba, struct diag *diag)
{
    FILE *file = fopen(path, "wb");
    if (!file)
        return diag_set(diag, -errno, "%s: %s", path, strerror(errno));
    png_structp png = png_create_write_struct(PNG_LIBPNG_VER_STRING, NULL, NULL, NULL);
    png_infop info = png ? png_create_info_struct(png) : NULL;
    int r = info ? write_rows(png, info, file, width, height, rgba) : -ENOMEM;
    png_destroy_write_struct(&png, &info);
    if (fclose(file) != 0 && r == 0)
        r = -errno;
    return r < 0 ? diag_set(diag, r, "%s: cannot write the picture: %s", path, strerror(-r)) : 0;
}

static void register_gdal_tags(TIFF *tiff)
{
    static const TIFFFieldInfo fields[] = {
        {TIFFTAG_GDAL_META, TIFF_VARIABLE, TIFF_VARIABLE, TIFF_ASCII, FIELD_CUSTOM, 1, 0,
         (char *)"GDALMetadata"},
        {TIFFTAG_GDAL_NODATA, TIFF_VARIABLE, TIFF_VARIABLE, TIFF_ASCII, FIELD_CUSTOM, 1, 0,
         (char *)"GDALNoData"},
    };
    TIFFMergeFieldInfo(tiff, fields, 2);
}

int image_write_geo(const char *path, int width, int height, const double *lat_lon_height,
                    struct diag *diag)
{
    static const char names[] = "<GDALMetadata>"
                                "<Item name=\"DESCRIPTION\" sample=\"0\" role=\"description\">"
                                "geodetic latitude, deg</Item>"
                                "<Item name=\"DESCRIPTION\" sample=\"1\" role=\"description\">"
                                "longitude, deg</Item>"
                                "<Item name=\"DESCRIPTION\" sample=\"2\" role=\"description\">"
                                "height above the WGS84 ellipsoid, m</Item></GDALMetadata>";
    TIFF *tiff = TIFFOpen(path, "w");
    if (!tiff)
        return diag_set(diag, -EIO, "%s: cannot create the file", path);
    register_gdal_tags(tiff);
    TIFFSetField(tiff, TIFFTAG_IMAGEWIDTH, width);
    TIFFSetField(tiff, TIFFTAG_IMAGELENGTH, height);
    TIFFSetField(tiff, TIFFTAG_SAMPLESPERPIXEL, 3);
    TIFFSetField(tiff, TIFFTAG_BITSPERSAMPLE, 64);
    TIFFSetField(tiff, TIFFTAG_SAMPLEFORMAT, SAMPLEFORMAT_IEEEFP);
    TIFFSetField(tiff, TIFFTAG_PLANARCONFIG, PLANARCONFIG_CONTIG);
    TIFFSetField(tiff, TIFFTAG_PHOTOMETRIC, PHOTOMETRIC_MINISBLACK);
    const uint16_t extra[2] = {EXTRASAMPLE_UNSPECIFIED, EXTRASAMPLE_UNSPECIFIED};
    TIFFSetField(tiff, TIFFTAG_EXTRASAMPLES, 2, extra);
    TIFFSetField(tiff, TIFFTAG_COMPRESSION, COMPRESSION_ADOBE_DEFLATE);
    TIFFSetField(tiff, TIFFTAG_ZIPQUALITY, 1);
    TIFFSetField(tiff, TIFFTAG_ROWSPERSTRIP, 64);
    TIFFSetField(tiff, TIFFTAG_GDAL_META, names);
    TIFFSetField(tiff, TIFFTAG_GDAL_NODATA, "nan");
    int r = 0;
    double *line = malloc((size_t)width * 3 * sizeof(*line)); /* libtiff may swap bytes in place */
    if (!line)
        r = -ENOMEM;
    for (int row = 0; row < height && r == 0; row++) {
        memcpy(line, lat_lon_height + (size_t)row * (size_t)width * 3,
               (size_t)width * 3 * sizeof(*line));
        if (TIFFWriteScanline(tiff, line, (uint32_t)row, 0) < 0)
            r = -EIO;
    }
    if (r == 0 && !TIFFFlush(tiff))
        r = -EIO;
    TIFFClose(tiff);
    free(line);
    return r < 0 ? diag_set(diag, r, "%s: cannot write the image: %s", path, strerror(-r)) : 0;
}
