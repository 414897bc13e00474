/* perifort for C and whatever calls C. doc/library.md explains it; ./pf library builds it.
 *
 * Functions that can fail give a status, 0 if all went well; perifort_message() then says what was
 * wrong. NULL, freed handles, handles of another kind and unknown names are refused, not followed.
 * One call at a time: neither the library nor HDF5 may be entered by two threads at once.
 */
#ifndef PERIFORT_H
#define PERIFORT_H

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

enum {
  PERIFORT_OK = 0,
  PERIFORT_INPUT = 1,       /* the scene or the environment is at fault */
  PERIFORT_USAGE = 2,       /* a wrong call: no such handle, name or place for values */
  PERIFORT_NO_ANSWER = 3,   /* unstable, or not converged; the history is kept */
  PERIFORT_INTERRUPTED = 4  /* stopped in order, by a signal or an observer; the state is kept */
};

typedef struct perifort_scene perifort_scene;
typedef struct perifort_answer perifort_answer;

/* One instant of a run. */
typedef struct {
  int64_t step;              /* complete steps; iterations in relaxation */
  int64_t load_step;         /* relaxation */
  double time;               /* [s]; relaxation: 0 to 1 over the load steps */
  int64_t broken_bonds;      /* since the start */
  double dissipated_energy;  /* [J] */
  double external_work;      /* [J] */
  int last;                  /* 1: the final state */
} perifort_instant;

/* Sees every instant; a value other than 0 stops the run in order. It must not call the library, and
 * must return (no longjmp, no C++ exception). */
typedef int (*perifort_observer)(const perifort_instant *instant, void *data);

/* How to run; all zeros: in memory, without a word. */
typedef struct {
  const char *directory;      /* of the results; NULL or "": no files */
  int threads;                /* 0: as many as suit the scene */
  int overwrite;              /* 1: replace results that are there */
  int restart;                /* 1: go on from a checkpoint in the directory, if there is one */
  int verbose;                /* 1: print what the program prints */
  double max_minutes;         /* of wall time, then stop in order; 0: no limit */
  perifort_observer observe;  /* or NULL */
  void *data;                 /* for the observer */
} perifort_options;

const char *perifort_version(void);

/* What was wrong in the last call, "" if nothing was. Valid until the next call. */
const char *perifort_message(void);

/* Scenes. `name` stands for the file in messages and for files beside it; NULL: "scene". */
int perifort_read_scene(const char *path, perifort_scene **scene);
int perifort_scene_from_text(const char *text, const char *name, perifort_scene **scene);

/* Give a key another value, "time%steps" "500" or "boundary(2)%velocity_y" "20.0"; texts need no
 * quotes. The key is looked up at once; values and rules are checked by the next check, preview or
 * run, so that keys that depend on each other can be changed together. */
int perifort_set(perifort_scene *scene, const char *key, const char *value);

/* All rules of a scene file. */
int perifort_check(perifort_scene *scene);

/* What a run would do, with its duration predicted. The text belongs to the scene and is valid until
 * the next preview. */
int perifort_preview(perifort_scene *scene, int threads, const char **text);

/* Run. `options` may be NULL, and so may `answer`. After PERIFORT_NO_ANSWER and PERIFORT_INTERRUPTED
 * there is an answer, too; where there is none, NULL is put there. */
int perifort_run(perifort_scene *scene, const perifort_options *options, perifort_answer **answer);

/* The results in memory. Counts are -1, texts NULL and times -1 where something is wrong; numbers of
 * columns and fields begin with 0; texts belong to the answer. */
int64_t perifort_rows(const perifort_answer *answer);
int64_t perifort_columns(const perifort_answer *answer);
int64_t perifort_points(const perifort_answer *answer);
int64_t perifort_fields(const perifort_answer *answer);
const char *perifort_column_name(const perifort_answer *answer, int64_t number);
const char *perifort_column_unit(const perifort_answer *answer, int64_t number);
const char *perifort_field_name(const perifort_answer *answer, int64_t number);
const char *perifort_field_unit(const perifort_answer *answer, int64_t number);
int perifort_components(const perifort_answer *answer, const char *field);
double perifort_time(const perifort_answer *answer); /* of the last output [s] */
const char *perifort_warnings(const perifort_answer *answer);

/* Values into an array of `size` numbers: a column of the history, a number for each row; a field of
 * the last output, or the positions before the motion [m], with the components of a point side by
 * side. Vectors have three components in any dimension. */
int perifort_column(const perifort_answer *answer, const char *name, double *values, int64_t size);
int perifort_field(const perifort_answer *answer, const char *name, double *values, int64_t size);
int perifort_positions(const perifort_answer *answer, double *values, int64_t size);

/* NULL and handles that were freed do no harm. */
void perifort_free_scene(perifort_scene *scene);
void perifort_free_answer(perifort_answer *answer);

#ifdef __cplusplus
}
#endif

#endif
