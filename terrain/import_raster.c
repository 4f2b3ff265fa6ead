/* Opening a raster: what it is, where it lies, what its numbers mean. */
#include <cpl_conv.h>
#include <cpl_error.h>
#include <cpl_string.h>
#include <cpl_vsi.h>
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "terrain/height_step.h"
#include "terrain/import_raster_internal.h"

void raster_start_up(int cache_mib)
{
    GDALAllRegister();
    CPLSetErrorHandler(CPLQuietErrorHandler);
    GDALSetCacheMax64((GIntBig)cache_mib << 20);
    CPLSetConfigOption("OGR_CT_FORCE_TRADITIONAL_GIS_ORDER", "NO");
}

static void drop_transformations(struct raster *raster)
{
    if (raster->from_lonlat)
        OCTDestroyCoordinateTransformation(raster->from_lonlat);
    if (raster->to_lonlat)
        OCTDestroyCoordinateTransformation(raster->to_lonlat);
    raster->from_lonlat = raster->to_lonlat = NULL;
}

void raster_close(struct raster *raster)
{
    if (!raster)
        return;
    drop_transformations(raster);
    if (raster->dataset)
        GDALClose(raster->dataset);
    free(raster->lon);
    free(raster->lat);
    free(raster->window);
    free(raster);
}

void raster_get_facts(const struct raster *raster, struct raster_facts *ret_facts)
{
    *ret_facts = raster->facts;
}

static double metres_of_unit(const char *unit)
{
    if (strcasecmp(unit, "ft") == 0 || strcasecmp(unit, "foot") == 0 ||
        strcasecmp(unit, "feet") == 0)
        return 0.3048;
    if (strcasecmp(unit, "us-ft") == 0 || strcasestr(unit, "US survey foot"))
        return 1200.0 / 3937.0;
    return 1.0;
}

static int check_bands(struct raster *raster, bool image, struct diag *diag)
{
    int bands = GDALGetRasterCount(raster->dataset);
    if (bands == 0)
        return diag_set(diag, -EBADMSG, "%s holds no raster band", raster->path);
    raster->band = GDALGetRasterBand(raster->dataset, 1);
    if (image)
        return 0;
    GDALDataType type = GDALGetRasterDataType(raster->band);
    if (bands >= 3 || GDALGetRasterColorTable(raster->band))
        return diag_set(diag, -EBADMSG, "%s is an image (%d bands of %s), not elevation",
                        raster->path, bands, GDALGetDataTypeName(type));
    if (GDALDataTypeIsComplex(type))
        return diag_set(diag, -EBADMSG, "%s has complex numbers, not elevation", raster->path);
    return 0;
}

static void read_value_meaning(struct raster *raster, const struct raster_options *options)
{
    int has = 0, has_scale = 0, has_offset = 0;
    raster->nodata = GDALGetRasterNoDataValue(raster->band, &has);
    raster->has_nodata = has;
    if (options->nodata) {
        raster->nodata = *options->nodata;
        raster->has_nodata = raster->has_option_nodata = true;
    }
    double metres = metres_of_unit(GDALGetRasterUnitType(raster->band));
    double scale = GDALGetRasterScale(raster->band, &has_scale);
    double offset = GDALGetRasterOffset(raster->band, &has_offset);
    raster->scale = (has_scale && scale != 0.0 ? scale : 1.0) * metres;
    raster->offset = (has_offset ? offset : 0.0) * metres;
    double low = (HEIGHT_MIN_M - raster->offset) / raster->scale;
    double high = (HEIGHT_MAX_M - raster->offset) / raster->scale;
    raster->lowest = (float)fmin(low, high);
    raster->highest = (float)fmax(low, high);
    double units = raster->offset / raster->scale;
    if (GDALDataTypeIsInteger(GDALGetRasterDataType(raster->band)) &&
        fabs(units - nearbyint(units)) < 1e-9)
        raster->facts.unit_m = fabs(raster->scale);
    const char *kind = GDALGetMetadataItem(raster->dataset, "AREA_OR_POINT", NULL);
    raster->area = !kind || strcasecmp(kind, "Point") != 0;
}

static int read_placement(struct raster *raster, struct diag *diag)
{
    double gt[6];
    if (GDALGetGeoTransform(raster->dataset, gt) != CE_None)
        return diag_set(diag, -EBADMSG,
                        GDALGetGCPCount(raster->dataset) > 0
                            ? "%s has ground control points, not a georeference: bring it into "
                              "place with gdalwarp"
                            : "%s has no georeference: nothing says where it lies (gdal_translate "
                              "-a_ullr gives it one)",
                        raster->path);
    if (fabs(gt[2]) > 1e-9 * fabs(gt[1]) || fabs(gt[4]) > 1e-9 * fabs(gt[5]))
        return diag_set(diag, -EBADMSG,
                        "%s is rotated against its axes: straighten it with gdalwarp",
                        raster->path);
    if (!isfinite(gt[0]) || !isfinite(gt[3]) || !isfinite(gt[1]) || !isfinite(gt[5]) ||
        gt[1] == 0.0 || gt[5] == 0.0)
        return diag_set(diag, -EBADMSG, "%s has an impossible georeference", raster->path);
    raster->dx = gt[1];
    raster->dy = gt[5];
    raster->west = gt[0] + 0.5 * gt[1];
    raster->north = gt[3] + 0.5 * gt[5];
    return 0;
}

/* The raster's own, as far as it says where on the Earth it lies; NULL. */
static OGRSpatialReferenceH own_crs(const struct raster *raster)
{
    OGRSpatialReferenceH own = GDALGetSpatialRef(raster->dataset);
    return own && !OSRIsLocal(own) ? OSRClone(own) : NULL;
}

/* The option's, checked even where no raster needs it. */
static int given_crs(const struct raster_options *options, OGRSpatialReferenceH *ret_crs,
                     struct diag *diag)
{
    if (!options->crs)
        return 0;
    OGRSpatialReferenceH crs = OSRNewSpatialReference(NULL);
    if (OSRSetFromUserInput(crs, options->crs) != OGRERR_NONE) {
        OSRDestroySpatialReference(crs);
        return diag_set(diag, -EINVAL, "--crs %s is no coordinate reference system that PROJ knows",
                        options->crs);
    }
    *ret_crs = crs;
    return 0;
}

/* False where there is no way between this system and WGS84. */
static bool connect_crs(struct raster *raster, OGRSpatialReferenceH crs)
{
    if (OSRIsCompound(crs))
        OSRStripVertical(crs);
    OSRSetAxisMappingStrategy(crs, OAMS_TRADITIONAL_GIS_ORDER);
    OGRSpatialReferenceH wgs84 = OSRNewSpatialReference(NULL);
    OSRSetWellKnownGeogCS(wgs84, "WGS84");
    OSRSetAxisMappingStrategy(wgs84, OAMS_TRADITIONAL_GIS_ORDER);
    raster->to_lonlat = OCTNewCoordinateTransformation(crs, wgs84);
    raster->from_lonlat = OCTNewCoordinateTransformation(wgs84, crs);
    OSRDestroySpatialReference(wgs84);
    if (raster->to_lonlat && raster->from_lonlat)
        return true;
    drop_transformations(raster);
    return false;
}

/* True where longitude and latitude pass through unchanged (to 1e-10 degrees, 0.01 mm). */
static bool is_identity(struct raster *raster)
{
    for (int i = 0; i < 9; i++) {
        double x = raster->west + raster->dx * (raster->facts.width - 1) * (i % 3) / 2.0;
        double y = raster->north + raster->dy * (raster->facts.height - 1) * (i / 3) / 2.0;
        double lon = x, lat = y;
        if (!OCTTransform(raster->to_lonlat, 1, &lon, &lat, NULL) ||
            fabs(remainder(lon - x, 360.0)) > 1e-10 || fabs(lat - y) > 1e-10)
            return false;
    }
    return true;
}

/* A raster's own system goes before the option's, which is for rasters that have none to use. */
static int make_transformations(struct raster *raster, const struct raster_options *options,
                                struct diag *diag)
{
    OGRSpatialReferenceH own = own_crs(raster), given = NULL, used = NULL;
    int r = given_crs(options, &given, diag);
    if (r == 0 && own && connect_crs(raster, own))
        used = own;
    else if (r == 0 && given && connect_crs(raster, given))
        used = given;
    if (r == 0 && !own && !given)
        r = diag_set(diag, -EBADMSG,
                     "%s has no coordinate reference system: give one with --crs, such as --crs "
                     "EPSG:4326",
                     raster->path);
    else if (r == 0 && !used)
        r = diag_set(diag, -EBADMSG, "%s: no way from %s coordinate system to WGS84: %s",
                     raster->path, given ? "the given" : "its", CPLGetLastErrorMsg());
    bool geographic = used && OSRIsGeographic(used);
    OSRDestroySpatialReference(own);
    OSRDestroySpatialReference(given);
    if (r < 0)
        return r;
    raster->facts.geographic = geographic && is_identity(raster);
    if (raster->facts.geographic) {
        drop_transformations(raster);
        double turn = fabs(raster->dx) * raster->facts.width;
        raster->periodic = fabs(turn - 360.0) < 1e-3 * fabs(raster->dx);
    }
    return 0;
}

static void extent_geographic(struct raster *raster)
{
    double last_x = raster->west + raster->dx * (raster->facts.width - 1);
    double last_y = raster->north + raster->dy * (raster->facts.height - 1);
    double margin_x = raster->area ? 0.5 * fabs(raster->dx) : 0.0;
    double margin_y = raster->area ? 0.5 * fabs(raster->dy) : 0.0;
    struct raster_facts *facts = &raster->facts;
    facts->west_deg = fmin(raster->west, last_x) - margin_x;
    facts->east_deg = fmax(raster->west, last_x) + margin_x;
    facts->south_deg = fmax(fmin(raster->north, last_y) - margin_y, -90.0);
    facts->north_deg = fmin(fmax(raster->north, last_y) + margin_y, 90.0);
    if (raster->periodic || facts->east_deg - facts->west_deg >= 360.0) {
        facts->west_deg = -180.0;
        facts->east_deg = 180.0;
    }
    double turns = floor((facts->west_deg + 180.0 + 1e-9) / 360.0) * 360.0;
    facts->west_deg -= turns;
    facts->east_deg -= turns;
}

/* Whether a pole lies on a projected raster. */
static bool holds_pole(struct raster *raster, double lat_deg)
{
    double x = 0.0, y = lat_deg;
    if (!OCTTransform(raster->from_lonlat, 1, &x, &y, NULL))
        return false;
    double column = (x - raster->west) / raster->dx, row = (y - raster->north) / raster->dy;
    return column >= 0 && row >= 0 && column < raster->facts.width && row < raster->facts.height;
}

/* From a mesh of points on the raster, widened by what can lie between them. */
static int extent_projected(struct raster *raster, struct diag *diag)
{
    enum { MESH = 32 };
    struct raster_facts *facts = &raster->facts;
    double middle_x = raster->west + raster->dx * (facts->width - 1) / 2.0;
    double middle_y = raster->north + raster->dy * (facts->height - 1) / 2.0;
    bool ok = OCTTransform(raster->to_lonlat, 1, &middle_x, &middle_y, NULL);
    double south = 90.0, north = -90.0, west = 1e9, east = -1e9;
    for (int i = 0; ok && i <= MESH * (MESH + 2); i++) {
        double x =
            raster->west + raster->dx * ((facts->width) * (i % (MESH + 1)) / (double)MESH - 0.5);
        double y =
            raster->north + raster->dy * ((facts->height) * (i / (MESH + 1)) / (double)MESH - 0.5);
        if (!OCTTransform(raster->to_lonlat, 1, &x, &y, NULL) || !isfinite(x) || !isfinite(y))
            continue;
        x = middle_x + remainder(x - middle_x, 360.0);
        south = fmin(south, y);
        north = fmax(north, y);
        west = fmin(west, x);
        east = fmax(east, x);
    }
    if (!ok || south > north)
        return diag_set(diag, -EBADMSG, "%s: its place cannot be brought to WGS84", raster->path);
    double margin_lat = 0.02 * (north - south), margin_lon = 0.02 * (east - west);
    bool poles[2] = {holds_pole(raster, -90.0), holds_pole(raster, 90.0)};
    facts->south_deg = poles[0] ? -90.0 : fmax(south - margin_lat, -90.0);
    facts->north_deg = poles[1] ? 90.0 : fmin(north + margin_lat, 90.0);
    facts->west_deg = poles[0] || poles[1] ? -180.0 : west - margin_lon;
    facts->east_deg = poles[0] || poles[1] ? 180.0 : east + margin_lon;
    double turns = floor((facts->west_deg + 180.0) / 360.0) * 360.0;
    facts->west_deg -= turns;
    facts->east_deg -= turns;
    return 0;
}

int raster_open_dataset(const char *path, GDALDatasetH *ret_dataset, struct diag *diag)
{
    VSIStatBufL status;
    CPLErrorReset();
    GDALDatasetH dataset = GDALOpenEx(path, GDAL_OF_RASTER | GDAL_OF_READONLY, NULL, NULL, NULL);
    if (dataset) {
        *ret_dataset = dataset;
        return 0;
    }
    char reason[256];
    snprintf(reason, sizeof(reason), "%s", CPLGetLastErrorMsg());
    if (VSIStatL(path, &status) != 0)
        return diag_set(diag, -ENOENT, "%s: No such file or directory", path);
    if (status.st_size == 0)
        return diag_set(diag, -EBADMSG, "%s is empty", path);
    return diag_set(diag, -EBADMSG, "%s cannot be read as a raster (%s)", path,
                    reason[0] ? reason : "unknown format");
}

int raster_open(const char *path, const struct raster_options *options, struct raster **ret_raster,
                struct diag *diag)
{
    struct raster *raster = calloc(1, sizeof(*raster));
    if (!raster)
        return -ENOMEM;
    snprintf(raster->path, sizeof(raster->path), "%s", path);
    raster->lon = malloc(RASTER_CHUNK * sizeof(double));
    raster->lat = malloc(RASTER_CHUNK * sizeof(double));
    int r = raster->lon && raster->lat ? raster_open_dataset(raster->path, &raster->dataset, diag)
                                       : -ENOMEM;
    if (r == 0)
        r = check_bands(raster, options->image, diag);
    if (r == 0) {
        raster->facts.width = GDALGetRasterXSize(raster->dataset);
        raster->facts.height = GDALGetRasterYSize(raster->dataset);
        read_value_meaning(raster, options);
        r = read_placement(raster, diag);
    }
    if (r == 0)
        r = make_transformations(raster, options, diag);
    if (r == 0 && raster->facts.geographic)
        extent_geographic(raster);
    else if (r == 0)
        r = extent_projected(raster, diag);
    if (r == 0) {
        raster_measure_spacing(raster);
        *ret_raster = raster;
    } else {
        raster_close(raster);
    }
    return r;
}

static bool ends_with(const char *text, const char *end)
{
    size_t length = strlen(text), tail = strlen(end);
    return length >= tail && strcasecmp(text + length - tail, end) == 0;
}

/* The file of a path such as /vsizip/a.zip or /vsizip/{a.zip}. */
static void archive_file(const char *path, char *ret_file, size_t size)
{
    const char *file = strncmp(path, "/vsizip/", 8) == 0 ? path + 8 : path;
    size_t length = strlen(file);
    bool braces = file[0] == '{' && length > 1 && file[length - 1] == '}';
    snprintf(ret_file, size, "%.*s", (int)(braces ? length - 2 : length), file + braces);
}

/* Why an archive gives no raster. Zip: APPNOTE.TXT 6.3.10, 4.3.16, the record that ends it. */
static int no_raster_inside(const char *path, const char *file, char **names, struct diag *diag)
{
    VSIStatBufL status;
    char begin[4] = "";
    if (VSIStatL(file, &status) != 0)
        return diag_set(diag, -ENOENT, "%s: No such file or directory", path);
    VSILFILE *open = VSIFOpenL(file, "rb");
    size_t got = open ? VSIFReadL(begin, 1, sizeof(begin), open) : 0;
    if (open)
        VSIFCloseL(open);
    if (names && names[0])
        return diag_set(diag, -EBADMSG, "%s holds no raster that can be read, but %s%s", path,
                        names[0], names[1] ? " and others" : "");
    if (got == sizeof(begin) && memcmp(begin, "PK\5\6", sizeof(begin)) == 0)
        return diag_set(diag, -EBADMSG, "%s is an archive with nothing in it", path);
    return diag_set(diag, -EBADMSG, "%s is no zip archive, or damaged or cut short", path);
}

int raster_expand(const char *path, int (*function)(void *user, const char *path), void *user,
                  struct diag *diag)
{
    char file[1024], inside[1040];
    archive_file(path, file, sizeof(file));
    if (!ends_with(file, ".zip") || GDALIdentifyDriverEx(path, GDAL_OF_RASTER, NULL, NULL))
        return function(user, path);
    snprintf(inside, sizeof(inside), "/vsizip/{%s}", file);
    char **names = VSIReadDirRecursive(inside);
    int rasters = 0, r = 0;
    for (int i = 0; r == 0 && names && names[i]; i++) {
        char member[2048];
        snprintf(member, sizeof(member), "%s/%s", inside, names[i]);
        if (ends_with(member, "/") || !GDALIdentifyDriverEx(member, GDAL_OF_RASTER, NULL, NULL))
            continue;
        rasters++;
        r = function(user, member);
    }
    if (r == 0 && rasters == 0)
        r = no_raster_inside(path, file, names, diag);
    CSLDestroy(names);
    return r;
}

int raster_file_state(const char *path, uint64_t *ret_bytes, int64_t *ret_time_ns)
{
    VSIStatBufL status;
    if (VSIStatL(path, &status) != 0)
        return -ENOENT;
    *ret_bytes = (uint64_t)status.st_size;
    *ret_time_ns = status.st_mtim.tv_sec * INT64_C(1000000000) + status.st_mtim.tv_nsec;
    return 0;
}
