/* The C interface in wrong hands: every check prints what failed; the status is their number. */
#include <math.h>
#include <omp.h>
#include <perifort.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

static int failed = 0, checks = 0;

#define CHECK(what)                                                               \
  do {                                                                            \
    checks++;                                                                     \
    if (!(what)) {                                                                \
      failed++;                                                                   \
      printf("FAILED: line %d: %s\n  message: %s\n", __LINE__, #what, perifort_message()); \
    }                                                                             \
  } while (0)

static const char bar[] =
    "&scene\n dimension = 1\n/\n&body\n lower = 0.0\n upper = 1.0\n points = 50\n/\n"
    "&material\n model = 'bond_based'\n youngs_modulus = 200.0e9\n density = 7850.0\n/\n"
    "&initial\n velocity_x = 3.0\n/\n&time\n steps = 20\n/\n&output\n history_every = 1\n/\n"
    "&probe\n name = 'tip'\n point = 1.0\n/\n";

static int seen, stop_at;

static int observe(const perifort_instant *instant, void *data) {
  seen++;
  *(double *)data = instant->time;
  return instant->step == stop_at;
}

static int mine = 0;
static void handler(int number) { mine = number; }

static void null_and_wrong_handles(void) {
  perifort_scene *scene = NULL;
  perifort_answer *answer = NULL;
  double values[10];
  const char *text = "unchanged";
  int local = 0;

  CHECK(perifort_read_scene(NULL, &scene) == PERIFORT_USAGE && scene == NULL);
  CHECK(strlen(perifort_message()) > 0);
  CHECK(perifort_read_scene("no/such/file.nml", &scene) == PERIFORT_INPUT && scene == NULL);
  CHECK(strstr(perifort_message(), "no/such/file.nml") != NULL);
  CHECK(perifort_scene_from_text(NULL, NULL, &scene) == PERIFORT_USAGE);
  CHECK(perifort_scene_from_text(bar, NULL, NULL) == PERIFORT_USAGE);
  CHECK(perifort_scene_from_text("", NULL, &scene) == PERIFORT_INPUT && scene == NULL);
  CHECK(perifort_scene_from_text("&scene\n dimension = 1\n stps = 3\n/\n", "my.nml", &scene) == PERIFORT_INPUT);
  CHECK(strstr(perifort_message(), "my.nml:3") != NULL);
  CHECK(perifort_set(NULL, "time%steps", "3") == PERIFORT_USAGE);
  CHECK(perifort_check(NULL) == PERIFORT_USAGE);
  CHECK(perifort_check((perifort_scene *)&local) == PERIFORT_USAGE);
  CHECK(perifort_preview(NULL, 0, &text) == PERIFORT_USAGE && text == NULL);
  CHECK(perifort_run(NULL, NULL, &answer) == PERIFORT_USAGE && answer == NULL);
  CHECK(perifort_rows(NULL) == -1 && perifort_columns(NULL) == -1 && perifort_points(NULL) == -1);
  CHECK(perifort_fields(NULL) == -1 && perifort_components(NULL, "velocity") == -1);
  CHECK(perifort_column_name(NULL, 0) == NULL && perifort_column_unit(NULL, 0) == NULL);
  CHECK(perifort_field_name(NULL, 0) == NULL && perifort_field_unit(NULL, 0) == NULL);
  CHECK(perifort_warnings(NULL) == NULL && perifort_time(NULL) == -1.0);
  CHECK(perifort_column(NULL, "time", values, 10) == PERIFORT_USAGE);
  CHECK(perifort_field(NULL, "velocity", values, 10) == PERIFORT_USAGE);
  CHECK(perifort_positions(NULL, values, 10) == PERIFORT_USAGE);
  perifort_free_scene(NULL);
  perifort_free_answer(NULL);
  perifort_free_scene((perifort_scene *)&local);
}

static void a_flight(void) {
  perifort_scene *scene;
  perifort_answer *answer;
  double *values, time = -1.0;
  const char *text;
  int64_t rows, points, i;

  CHECK(perifort_scene_from_text(bar, "bar", &scene) == PERIFORT_OK && scene != NULL);
  CHECK(strcmp(perifort_message(), "") == 0);
  CHECK(perifort_check(scene) == PERIFORT_OK);
  CHECK(perifort_check((perifort_scene *)((char *)scene + 1)) == PERIFORT_USAGE);
  CHECK(perifort_preview(scene, 1, &text) == PERIFORT_OK && strstr(text, "points          50 in 1D") != NULL);
  CHECK(perifort_preview(scene, -1, &text) == PERIFORT_USAGE && text == NULL);
  CHECK(perifort_preview(scene, 1, NULL) == PERIFORT_OK);
  CHECK(perifort_run(scene, NULL, NULL) == PERIFORT_OK);
  CHECK(perifort_run(scene, NULL, &answer) == PERIFORT_OK && answer != NULL);
  CHECK(perifort_run((perifort_scene *)answer, NULL, NULL) == PERIFORT_USAGE);
  CHECK(perifort_rows((perifort_answer *)scene) == -1);

  /* a bar that flies at 3 m/s */
  rows = perifort_rows(answer);
  points = perifort_points(answer);
  CHECK(rows == 21 && points == 50 && perifort_fields(answer) == 3);
  values = malloc(3 * points * sizeof *values);
  CHECK(perifort_column(answer, "time", values, rows) == PERIFORT_OK);
  time = values[rows - 1];
  CHECK(time > 0.0 && fabs(perifort_time(answer) - time) < 1e-12 * time);
  CHECK(perifort_column(answer, "tip_displacement_x", values, rows) == PERIFORT_OK);
  CHECK(fabs(values[rows - 1] - 3.0 * time) < 1e-12 * 3.0 * time);
  CHECK(perifort_components(answer, "displacement") == 3 && perifort_components(answer, "damage") == 1);
  CHECK(perifort_field(answer, "displacement", values, 3 * points) == PERIFORT_OK);
  for (i = 0; i < points; i++)
    CHECK(fabs(values[3 * i] - 3.0 * time) < 1e-12 * 3.0 * time && values[3 * i + 1] == 0.0);
  CHECK(perifort_positions(answer, values, 3 * points) == PERIFORT_OK);
  for (i = 0; i < points; i++) CHECK(fabs(values[3 * i] - (i + 0.5) / 50) < 1e-14);
  for (i = 0; i < perifort_columns(answer); i++)
    CHECK(strlen(perifort_column_name(answer, i)) > 0 && strlen(perifort_column_unit(answer, i)) > 0);
  CHECK(strcmp(perifort_column_name(answer, 1), "time") == 0 && strcmp(perifort_column_unit(answer, 1), "s") == 0);
  CHECK(strcmp(perifort_field_name(answer, 1), "velocity") == 0 && strcmp(perifort_field_unit(answer, 1), "m/s") == 0);
  CHECK(perifort_warnings(answer) != NULL);

  /* wrong names, numbers and places */
  CHECK(perifort_column(answer, "tiem", values, rows) == PERIFORT_USAGE && strstr(perifort_message(), "'time'") != NULL);
  CHECK(perifort_column(answer, NULL, values, rows) == PERIFORT_USAGE);
  CHECK(perifort_column(answer, "time", NULL, rows) == PERIFORT_USAGE);
  CHECK(perifort_column(answer, "time", values, rows - 1) == PERIFORT_USAGE && strstr(perifort_message(), "21") != NULL);
  CHECK(perifort_column(answer, "time", values, -5) == PERIFORT_USAGE);
  CHECK(perifort_field(answer, "stress", values, 3 * points) == PERIFORT_USAGE);
  CHECK(perifort_field(answer, NULL, values, 3 * points) == PERIFORT_USAGE);
  CHECK(perifort_field(answer, "velocity", values, points) == PERIFORT_USAGE);
  CHECK(perifort_components(answer, "") == -1);
  CHECK(perifort_column_name(answer, -1) == NULL && perifort_column_name(answer, 1000) == NULL);
  CHECK(perifort_field_unit(answer, 3) == NULL);
  free(values);
  perifort_free_answer(answer);
  CHECK(perifort_rows(answer) == -1);
  perifort_free_answer(answer);
  perifort_free_scene(scene);
  CHECK(perifort_check(scene) == PERIFORT_USAGE);
  perifort_free_scene(scene);
}

static void keys(void) {
  perifort_scene *scene;
  perifort_answer *answer;

  CHECK(perifort_scene_from_text(bar, "bar", &scene) == PERIFORT_OK);
  CHECK(perifort_set(scene, "time%stps", "3") == PERIFORT_INPUT && strstr(perifort_message(), "steps") != NULL);
  CHECK(perifort_set(scene, NULL, "3") == PERIFORT_USAGE && perifort_set(scene, "time%steps", NULL) == PERIFORT_USAGE);
  CHECK(perifort_check(scene) == PERIFORT_OK);
  CHECK(perifort_set(scene, "time%steps", "5") == PERIFORT_OK);
  CHECK(perifort_set(scene, "horizon%volume_correction", "none") == PERIFORT_OK);
  CHECK(perifort_run(scene, NULL, &answer) == PERIFORT_OK && perifort_rows(answer) == 6);
  perifort_free_answer(answer);
  /* a value that is wrong is told by the check, and a run does not use it */
  CHECK(perifort_set(scene, "time%steps", "-5") == PERIFORT_OK);
  CHECK(perifort_check(scene) == PERIFORT_INPUT && strstr(perifort_message(), "steps") != NULL);
  CHECK(perifort_run(scene, NULL, &answer) == PERIFORT_INPUT && answer == NULL);
  CHECK(perifort_set(scene, "steps", "7") == PERIFORT_OK);
  CHECK(perifort_run(scene, NULL, &answer) == PERIFORT_OK && perifort_rows(answer) == 8);
  perifort_free_answer(answer);
  CHECK(perifort_set(scene, "horizon%volume_correction", "") == PERIFORT_OK);
  CHECK(perifort_check(scene) == PERIFORT_INPUT);
  perifort_free_scene(scene);
}

static void hosts(void) {
  perifort_scene *scene;
  perifort_answer *answer;
  perifort_options options = {0};
  struct stat there;
  double time = -1.0;
  int threads;

  CHECK(perifort_scene_from_text(bar, "bar", &scene) == PERIFORT_OK);
  /* the host keeps its threads and its handlers */
  signal(SIGINT, handler);
  omp_set_num_threads(3);
  threads = omp_get_max_threads();
  options.threads = 2;
  CHECK(perifort_run(scene, &options, NULL) == PERIFORT_OK && omp_get_max_threads() == threads);
  CHECK(perifort_preview(scene, 2, NULL) == PERIFORT_OK && omp_get_max_threads() == threads);
  raise(SIGINT);
  CHECK(mine == SIGINT);
  signal(SIGINT, SIG_DFL);
  /* an observer sees every instant and stops in order */
  options.observe = observe;
  options.data = &time;
  stop_at = -1;
  seen = 0;
  CHECK(perifort_run(scene, &options, NULL) == PERIFORT_OK && seen == 21 && time > 0.0);
  stop_at = 4;
  seen = 0;
  CHECK(perifort_run(scene, &options, &answer) == PERIFORT_INTERRUPTED && answer != NULL && seen == 5);
  CHECK(perifort_rows(answer) == 5 && fabs(perifort_time(answer) - time) < 1e-15);
  perifort_free_answer(answer);
  options.observe = NULL;
  /* nothing is written unasked; where it is asked for, nothing is overwritten unasked */
  CHECK(stat("out", &there) != 0 && stat("bar.vtkhdf", &there) != 0);
  options.directory = "results";
  CHECK(perifort_run(scene, &options, NULL) == PERIFORT_OK && stat("results/bar.vtkhdf", &there) == 0);
  CHECK(perifort_run(scene, &options, &answer) == PERIFORT_INPUT && answer == NULL);
  options.overwrite = 1;
  CHECK(perifort_run(scene, &options, NULL) == PERIFORT_OK);
  options.threads = -1;
  CHECK(perifort_run(scene, &options, NULL) == PERIFORT_USAGE);
  options.threads = 0;
  options.max_minutes = NAN;
  CHECK(perifort_run(scene, &options, NULL) == PERIFORT_USAGE);
  options.max_minutes = 0;
  /* a run without an answer tells so, and keeps its history */
  options.directory = NULL;
  CHECK(perifort_set(scene, "initial%displacement_gradient(1,1)", "1.0e-3") == PERIFORT_OK);
  CHECK(perifort_set(scene, "time%step", "1.0e-4") == PERIFORT_OK && perifort_set(scene, "time%steps", "2000") == PERIFORT_OK);
  CHECK(perifort_run(scene, &options, &answer) == PERIFORT_NO_ANSWER && answer != NULL);
  CHECK(strstr(perifort_message(), "unstable") != NULL && perifort_rows(answer) > 0);
  perifort_free_answer(answer);
  perifort_free_scene(scene);
}

int main(void) {
  null_and_wrong_handles();
  a_flight();
  keys();
  hosts();
  printf("%d checks, %d failed\n", checks, failed);
  return failed > 0;
}
