/* The library from C: the bar of bar.nml, pulled with several forces.
 *
 *     ./pf library
 *     cc doc/examples/other_languages/from_c.c -Ibuild/lib -Lbuild/lib -lperifort -Wl,-rpath,$PWD/build/lib -lm
 *     ./a.out doc/examples/bar.nml
 */
#include <math.h>
#include <perifort.h>
#include <stdio.h>
#include <stdlib.h>

/* End the program with the message of a call that failed. */
static void need(int status) {
  if (status == PERIFORT_OK) return;
  fprintf(stderr, "%s\n", perifort_message());
  exit(1);
}

/* The last value of a column of the history. */
static double last(const perifort_answer *answer, const char *name) {
  int64_t rows = perifort_rows(answer);
  double *values = malloc(rows * sizeof *values), value;
  need(perifort_column(answer, name, values, rows));
  value = values[rows - 1];
  free(values);
  return value;
}

int main(int argc, char **argv) {
  const char *forces[] = {"1000.0", "2000.0", "-1000.0"};
  perifort_scene *scene;
  int i;

  printf("perifort %s\n", perifort_version());
  need(perifort_read_scene(argc > 1 ? argv[1] : "doc/examples/bar.nml", &scene));
  for (i = 0; i < 3; i++) {
    perifort_answer *answer;
    double strain, expected = atof(forces[i]) / (200.0e9 * 1.0e-3); /* F/(E A) */
    need(perifort_set(scene, "load%force_x", forces[i]));
    need(perifort_run(scene, NULL, &answer));
    strain = (last(answer, "right_displacement_x") - last(answer, "left_displacement_x")) / 0.5;
    printf("F %8s N   strain %12.4e   F/(E A) %12.4e\n", forces[i], strain, expected);
    perifort_free_answer(answer);
    if (!(fabs(strain / expected - 1) < 1e-3)) return 1;
  }
  perifort_free_scene(scene);
  return 0;
}
