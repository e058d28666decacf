/* A lidar that samples its receiver's voltage: an example of a sensor model that is not lidarcheck's.
 *
 *     waveform IDEAL SETTINGS SCAN SEED FRAME      one ideal scan
 *     waveform --server                            many: a JSON object a line asks, a line answers
 *
 * Each beam's pulses are added up in samples of 1 ns, with noise that grows with `Background` and with the light
 * itself. A filter of the pulse's own shape looks for it; its peaks above the threshold are echoes, the range by a
 * parabola through three samples. The converter has 12 bits: strong pulses are cut off.
 */
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { SAMPLES = 840, TAPS = 17, MATERIALS = 100, COLUMNS = 24, RETURNS = 2 };
static const double METRES = 0.149896229, FULL_SCALE = 4095.0, NEAREST = 0.5, FARTHEST = 120.0, STEP = 0.005;
typedef struct { long layer, point, material; double range, incidence, share, background; } Row;
typedef struct { double range, peak; } Echo;
static double energy, noise, threshold, pulse_ns, reflectance[MATERIALS], retro[MATERIALS];
static char problem[400];

static int fail(const char *what, const char *which) {
    snprintf(problem, sizeof problem, "%s%s", what, which);
    return 0;
}

/* How many rows from one on are of its beam. */
static long of_beam(const Row *rows, long first, long count) {
    long n = 1;
    const Row *one = rows + first;
    while (first + n < count && one[n].layer == one->layer && one[n].point == one->point) n++;
    return n;
}

static int read_settings(const char *path) {
    char line[512], key[64];
    double value, cutoff;
    FILE *file = fopen(path, "r");
    if (!file) return fail("cannot read ", path);
    energy = 400000, noise = 2, threshold = 6, pulse_ns = 5;
    for (int i = 0; i < MATERIALS; i++) reflectance[i] = -1, retro[i] = 0;
    while (fgets(line, sizeof line, file)) {
        if (sscanf(line, " %63[a-z_.0-9] = %lf", key, &value) != 2) continue;
        if (!strcmp(key, "energy")) energy = value;
        if (!strcmp(key, "noise")) noise = value;
        if (!strcmp(key, "threshold")) threshold = value;
        if (!strcmp(key, "pulse_ns")) pulse_ns = value;
        if (sscanf(key, "reflectance.%lf", &cutoff) == 1 && cutoff < MATERIALS) reflectance[(int)cutoff] = value;
        if (sscanf(key, "retro.%lf", &cutoff) == 1 && cutoff < MATERIALS) retro[(int)cutoff] = value;
    }
    fclose(file);
    return 1;
}

/* Columns come by name, in any order; without Share the rows of a beam divide its light evenly. */
static int read_ideal(const char *path, Row **rows, long *count) {
    char line[4096], *names[COLUMNS];
    int columns = 0, shares = 0;
    FILE *file = fopen(path, "r");
    if (!file || !fgets(line, sizeof line, file)) return fail("cannot read ", path);
    char *header = strcpy(malloc(strlen(line) + 1), line);
    char *name = strtok(header + strspn(header, "/ "), " \t\r\n");
    for (; name && columns < COLUMNS; name = strtok(NULL, " \t\r\n")) {
        shares |= !strcmp(name, "Share");
        names[columns++] = name;
    }
    if (!fgets(line, sizeof line, file) || sscanf(line, "%ld", count) != 1) return fail("no number of rows in ", path);
    *rows = calloc(*count + 1, sizeof(Row));
    for (long i = 0; i < *count; i++) {
        Row *row = *rows + i;
        row->background = 1;
        if (!fgets(line, sizeof line, file)) return fail("too few rows in ", path);
        char *at = line;
        for (int c = 0; c < columns; c++) {
            double value = strtod(at, &at);
            if (!strcmp(names[c], "Layer")) row->layer = (long)value;
            if (!strcmp(names[c], "Point")) row->point = (long)value;
            if (!strcmp(names[c], "Distance")) row->range = value;
            if (!strcmp(names[c], "MaterialID")) row->material = (long)value;
            if (!strcmp(names[c], "IncidenceAngle")) row->incidence = value;
            if (!strcmp(names[c], "Share")) row->share = value;
            if (!strcmp(names[c], "Background")) row->background = value;
        }
    }
    free(header), fclose(file);
    for (long i = 0, n; !shares && i < *count; i += n) {
        n = of_beam(*rows, i, *count);
        for (long k = i; k < i + n; k++) (*rows)[k].share = 1.0 / n;
    }
    return 1;
}

static uint64_t mixed(uint64_t x) { /* splitmix64: the same draw for the same beam, whatever other beams do */
    x += 0x9e3779b97f4a7c15u;
    x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9u;
    x = (x ^ (x >> 27)) * 0x94d049bb133111ebu;
    return x ^ (x >> 31);
}

static double normal(uint64_t key) { /* four even numbers are nearly normal, and the filter adds up many */
    uint64_t x = mixed(key);
    return ((double)(x & 0xffff) + (x >> 16 & 0xffff) + (x >> 32 & 0xffff) + (x >> 48) - 131070.0) / 37837.2;
}

static int by_peak(const void *a, const void *b) {
    double x = ((const Echo *)a)->peak, y = ((const Echo *)b)->peak;
    return (x < y) - (x > y);
}

static int by_range(const void *a, const void *b) {
    double x = ((const Echo *)a)->range, y = ((const Echo *)b)->range;
    return (x > y) - (x < y);
}

static int echoes_of(const Row *rows, long count, uint64_t seed, Echo *found) {
    double trace[SAMPLES] = {0}, taps[TAPS], sum = 0, sigma = pulse_ns / 2.3548;
    int number = 0;
    for (int k = 0; k < TAPS; k++) sum += taps[k] = exp(-0.5 * pow((k - TAPS / 2) / sigma, 2));
    for (int k = 0; k < TAPS; k++) taps[k] /= sum;
    for (long i = 0; i < count; i++) {
        const Row *row = rows + i;
        if (!(row->range > 0)) continue;
        double cosine = retro[row->material] > 0 ? retro[row->material] : cos(row->incidence * 0.017453292519943295);
        double peak = energy * row->share * reflectance[row->material] * cosine / (row->range * row->range);
        int middle = (int)(row->range / METRES);
        for (int s = middle - 12 < 0 ? 0 : middle - 12; s <= middle + 12 && s < SAMPLES; s++)
            trace[s] += peak * exp(-0.5 * pow((s - row->range / METRES) / sigma, 2));
    }
    uint64_t key = mixed(seed ^ mixed((uint64_t)rows->layer << 32 | (uint64_t)rows->point));
    for (int s = 0; s < SAMPLES; s++) {
        trace[s] += sqrt(noise * noise * rows->background + 0.5 * trace[s]) * normal(key + s);
        trace[s] = fmin(trace[s], FULL_SCALE);
    }
    double before = 0, here = 0;
    for (int s = TAPS / 2; s < SAMPLES - TAPS / 2 && number < 64; s++) {
        double after = 0;
        for (int k = 0; k < TAPS; k++) after += trace[s + k - TAPS / 2] * taps[k];
        if (here > threshold && here >= before && here > after) {
            double range = METRES * (s - 1 + 0.5 * (before - after) / (before - 2 * here + after));
            range = STEP * round(range / STEP);
            if (range >= NEAREST && range <= FARTHEST) found[number++] = (Echo){range, here};
        }
        before = here, here = after;
    }
    qsort(found, number, sizeof(Echo), by_peak);
    number = number < RETURNS ? number : RETURNS;
    qsort(found, number, sizeof(Echo), by_range);
    return number;
}

static int simulate(const char *ideal, const char *settings, const char *scan, uint64_t seed, uint64_t frame) {
    Row *rows = NULL;
    long count = 0;
    Echo found[64];
    if (!read_settings(settings) || !read_ideal(ideal, &rows, &count)) return free(rows), 0;
    for (long i = 0; i < count; i++) {
        long m = rows[i].material;
        if (rows[i].range > 0 && (m < 0 || m >= MATERIALS || reflectance[m] < 0))
            return free(rows), fail("a material without reflectance in ", settings);
    }
    FILE *file = fopen(scan, "w");
    if (!file) return free(rows), fail("cannot write ", scan);
    fprintf(file, "Layer Point RANGE EchoNumber INTENSITY\n");
    for (long i = 0, n; i < count; i += n) {
        n = of_beam(rows, i, count);
        int number = echoes_of(rows + i, n, mixed(seed) + frame, found);
        for (int e = 0; e < number; e++)
            fprintf(file, "%ld %ld %.3f %d %.0f\n", rows[i].layer, rows[i].point, found[e].range, e + 1, found[e].peak);
    }
    free(rows);
    return fclose(file) == 0 ? 1 : fail("cannot write ", scan);
}

/* The text or number of a key in a line of JSON, as lidarcheck writes it; no path of its own needs an escape. */
static void value_of(const char *line, const char *key, char *value, size_t size) {
    char quoted[32];
    snprintf(quoted, sizeof quoted, "\"%s\": ", key);
    const char *at = strstr(line, quoted);
    at = at ? at + strlen(quoted) : "";
    at += *at == '"';
    size_t length = strcspn(at, "\",}");
    snprintf(value, size, "%.*s", (int)(length < size ? length : size - 1), at);
}

static void serve(void) {
    static char line[1 << 20], id[32], ideal[4096], settings[4096], scan[4096], seed[32], frame[32];
    puts("{\"lidarcheck\": 1}"), fflush(stdout);
    while (fgets(line, sizeof line, stdin)) {
        value_of(line, "id", id, sizeof id);
        value_of(line, "ideal", ideal, sizeof ideal), value_of(line, "ini", settings, sizeof settings);
        value_of(line, "scan", scan, sizeof scan);
        value_of(line, "seed", seed, sizeof seed), value_of(line, "frame", frame, sizeof frame);
        if (simulate(ideal, settings, scan, strtoull(seed, NULL, 10), strtoull(frame, NULL, 10)))
            printf("{\"id\": %s}\n", id);
        else
            printf("{\"id\": %s, \"error\": \"%s\"}\n", id, problem);
        fflush(stdout);
    }
}

int main(int count, char **words) {
    if (count == 2 && !strcmp(words[1], "--server")) return serve(), 0;
    if (count != 6) return fputs("usage: waveform IDEAL SETTINGS SCAN SEED FRAME, or waveform --server\n", stderr), 2;
    uint64_t seed = strtoull(words[4], NULL, 10), frame = strtoull(words[5], NULL, 10);
    if (simulate(words[1], words[2], words[3], seed, frame)) return 0;
    return fprintf(stderr, "%s\n", problem), 1;
}
