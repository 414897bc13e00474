!> One measurement of the benchmark: a standard body, built as any scene is, moved for a while and
!> timed; and its arithmetic and memory traffic by the formulas.
module pd_study_bench_kernels
  use omp_lib, only: omp_get_max_threads, omp_set_num_threads
  use pd_base_clock, only: wall_time
  use pd_base_error, only: error_type, internal_fault
  use pd_base_kinds, only: wp, i8
  use pd_base_numbers, only: median, pi
  use pd_set_up_prepare, only: prepare, set_up_type
  use pd_family_family, only: family_type
  use pd_family_lattice, only: both_ends, lattice_family_type
  use pd_family_list, only: list_family_type
  use pd_force_model, only: dilatation_of, options_of, no_dilatation, projected, unprojected
  use pd_force_workspace, only: workspace_type
  use pd_law_laws, only: all_laws
  use pd_motion_explicit_integrators, only: run_explicit
  use pd_motion_observer, only: instant_type, observer_type
  use pd_motion_system, only: evaluate, system_type
  use pd_output_report_summary, only: memory_of
  use pd_scene_content_types, only: scene_type
  use pd_study_bench_machine, only: processor_time
  implicit none (type, external)
  private
  public :: kernel_type, timing_type, measure_kernel, standard_scene, bytes_needed, flops_of_bond, &
    & bytes_of_step

  !> What is measured.
  type :: kernel_type
    integer :: dimension = 3
    integer :: points = 80                         !! along an edge
    character(16) :: model = 'state_based'         !! 'bond_based'
    character(16) :: family = 'lattice'            !! 'list'
    character(8) :: precision = 'double'           !! 'mixed'
    logical :: breaking = .false.                  !! bonds can break; none gets near it
    logical :: surface = .false.                   !! surface correction
    logical :: generic = .false.                   !! the law on the generic pass
    integer :: threads = 1
  end type kernel_type

  !> What came out. Seconds are wall time of `steps` steps: the median of the repeats.
  type :: timing_type
    integer(i8) :: points = 0_i8                   !! all of them
    integer(i8) :: bonds = 0_i8                    !! directed: each counts from both ends
    integer :: steps = 0                           !! of one repeat
    integer :: repeats = 0
    real(wp) :: seconds = 0.0_wp                   !! [s]
    real(wp) :: least = 0.0_wp, most = 0.0_wp      !! of the repeats [s]
    real(wp) :: processor = 0.0_wp                 !! processor time over threads, the median [s]
    real(wp) :: forces = 0.0_wp                    !! one evaluation of the forces [s]
    real(wp) :: build = 0.0_wp                     !! families with their tables of weights [s]
    integer(i8) :: bytes = 0_i8                    !! memory of points and families
    real(wp) :: flops = 0.0_wp                     !! operations of a step, by the formulas
    real(wp) :: traffic = 0.0_wp                   !! bytes a step must move, by the formulas
    real(wp) :: strain = 0.0_wp                    !! largest |u| over the edge, for a check [-]
  end type timing_type

  !> Reads the clock every `stride` steps, and does nothing else.
  type, extends(observer_type) :: stopwatch_type
    integer :: stride = 1
    integer :: n = 0
    real(wp), allocatable :: wall(:), processor(:) !! at step 0, stride, 2 stride, ... [s]
  contains
    procedure :: observe => look_at_clock
  end type stopwatch_type

  integer, parameter :: round = 5                  !! repeats between looks at their spread
  integer, parameter :: most_rounds = 4
  integer, parameter :: most_steps = 10000000      !! of a repeat
  real(wp), parameter :: calm = 0.1_wp             !! spread over median at which repeats suffice

contains

  !> Build and time one kernel. Each repeat takes at least `seconds`; there are five, and on a
  !> machine with other work (least and most differ by over a tenth) up to twenty if they are short.
  !> An error if the scene cannot be set up or its run fails.
  subroutine measure_kernel(kernel, seconds, timing, error)
    type(kernel_type), intent(in) :: kernel   !! what is measured
    real(wp), intent(in) :: seconds           !! least wall time of a repeat [s]
    type(timing_type), intent(out) :: timing  !! what came out; without meaning after an error
    type(error_type), allocatable, intent(out) :: error
    type(set_up_type) :: set_up
    type(scene_type) :: scene
    integer :: threads_before

    threads_before = omp_get_max_threads()
    call omp_set_num_threads(kernel%threads)
    call standard_scene(kernel, scene)
    call prepare(scene, set_up, error)
    if (.not. allocated(error)) then
      associate (system => set_up%system)
        timing%points = system%body%n_points
        timing%bonds = system%family%n_bonds
        timing%bytes = memory_of(system)
        timing%build = set_up%timer%seconds('families') + set_up%timer%seconds('surface correction')
        timing%flops = flops_of_bond(system%family, system%workspace, &
          & dilatation_of(options_of(system%model)))*timing%bonds
        timing%traffic = bytes_of_step(system)
        if (kernel%generic) then  ! whose operations and traffic depend on the law
          timing%flops = 0.0_wp
          timing%traffic = 0.0_wp
        end if
        call start_moving(system, scene)
        call time_steps(system, set_up%plan%step, seconds, timing, error)
        if (.not. allocated(error)) call time_forces(system, seconds, timing)
        timing%strain = maxval(abs(system%state%u))/scene%bodies(1)%upper(1)
      end associate
    end if
    call omp_set_num_threads(threads_before)
  end subroutine measure_kernel

  !> A steel cube, plate or bar of a kernel's kind, horizon 3.015 spacings.
  subroutine standard_scene(kernel, scene)
    type(kernel_type), intent(in) :: kernel  !! gives dimension, points and what is measured of them
    type(scene_type), intent(out) :: scene   !! of one body without loads and boundaries, for one
                                             !! step
    real(wp), parameter :: spacing = 1.0e-3_wp                   ! [m]
    real(wp), parameter :: far_away = 0.1_wp                     ! stretch that is never reached [-]
    ! in 2D (plane stress) and 3D bond-based bodies have no other; in 1D any will do
    real(wp), parameter :: ratios(3) = [0.25_wp, 1.0_wp/3, 0.25_wp]
    integer :: i

    scene%file = ''
    scene%text = ''
    scene%header%dimension = kernel%dimension
    scene%header%thickness = spacing
    scene%header%area = spacing**2
    scene%header%precision = kernel%precision
    allocate (scene%bodies(1), scene%materials(1))
    scene%bodies(1)%name = 'body'
    scene%bodies(1)%lower(:kernel%dimension) = 0.0_wp
    scene%bodies(1)%upper(:kernel%dimension) = kernel%points*spacing
    scene%bodies(1)%points(:kernel%dimension) = kernel%points
    associate (material => scene%materials(1))
      material%name = 'steel'
      material%model = kernel%model
      material%youngs_modulus = 200.0e9_wp
      material%density = 7850.0_wp
      material%poissons_ratio = ratios(kernel%dimension)
      if (kernel%model == 'state_based') material%poissons_ratio = 0.3_wp
      if (kernel%breaking) material%critical_stretch = far_away
    end associate
    if (kernel%generic) then
      scene%laws = all_laws()
      do i = 1, size(scene%laws%items)
        scene%laws%items(i)%law%weighted = .false.
      end do
    end if
    scene%horizon%ratio = 3.015_wp
    scene%horizon%surface_correction = trim(merge('energy', 'none  ', kernel%surface))
    scene%horizon%family = kernel%family
    allocate (scene%kept(0), scene%removed(0), scene%regions(0), scene%sides(0), scene%cracks(0), &
      & scene%no_fail(0), scene%initial(0), scene%boundaries(0), scene%loads(0), &
      & scene%contacts(0), scene%rigids(0), scene%probes(0), scene%sections(0), scene%lines(0), &
      & scene%tips(0), scene%j_integrals(0), scene%output%fields(0))
    scene%time%steps = 1
  end subroutine standard_scene

  !> Waves a few wavelengths long with strains of 1e-4: no point rests, and none is strained much.
  subroutine start_moving(system, scene)
    type(system_type), intent(inout) :: system
    type(scene_type), intent(in) :: scene
    real(wp), parameter :: amplitude = 1.0e-4_wp
    real(wp) :: speed, edge, phase
    integer :: k, c, a

    edge = scene%bodies(1)%upper(1)
    speed = amplitude*sqrt(scene%materials(1)%youngs_modulus/scene%materials(1)%density)
    do c = 1, system%body%dim
      a = mod(c, system%body%dim) + 1
      do k = 1, system%body%n_slots
        if (system%body%point(k) == 0) cycle
        phase = (5*system%body%x(k, c) + 3*system%body%x(k, a))/edge
        system%state%v(k, c) = speed*sin(2*pi*phase + c)
      end do
    end do
  end subroutine start_moving

  !> Whole steps: impose, break where bonds can, forces, accounts, new velocities and displacements.
  subroutine time_steps(system, dt, seconds, timing, error)
    type(system_type), intent(inout) :: system
    real(wp), intent(in) :: dt, seconds
    type(timing_type), intent(inout) :: timing
    type(error_type), allocatable, intent(out) :: error
    type(stopwatch_type) :: watch
    real(wp), allocatable :: wall(:), processor(:)
    real(wp) :: one
    integer :: r

    watch%stride = 1
    do
      call run(watch, 1)
      if (allocated(error)) return
      one = watch%wall(2) - watch%wall(1)
      if (one > 0.2_wp*seconds .or. watch%stride > most_steps) exit
      watch%stride = 4*watch%stride
    end do
    watch%stride = max(1, ceiling(min(real(most_steps, wp), watch%stride*seconds &
      & /max(one, 1.0e-9_wp))))
    timing%steps = watch%stride
    allocate (wall(0), processor(0))
    do r = 1, most_rounds
      call run(watch, round)
      if (allocated(error)) return
      wall = [wall, watch%wall(2:) - watch%wall(:round)]
      processor = [processor, watch%processor(2:) - watch%processor(:round)]
      if (maxval(wall) - minval(wall) < calm*minval(wall) .or. sum(wall) > 3*round*seconds) exit
    end do
    timing%repeats = size(wall)
    timing%seconds = median(wall)
    timing%least = minval(wall)
    timing%most = maxval(wall)
    timing%processor = median(processor)/omp_get_max_threads()

  contains

    subroutine run(watch, strides)
      type(stopwatch_type), intent(inout) :: watch
      integer, intent(in) :: strides
      watch%n = 0
      if (allocated(watch%wall)) deallocate (watch%wall, watch%processor)
      allocate (watch%wall(strides + 1), watch%processor(strides + 1), source=0.0_wp)
      call run_explicit(system, 'forward_backward', dt, strides*watch%stride, watch, error)
    end subroutine run
  end subroutine time_steps

  !> Evaluations of the forces alone.
  subroutine time_forces(system, seconds, timing)
    type(system_type), intent(inout) :: system
    real(wp), intent(in) :: seconds
    type(timing_type), intent(inout) :: timing
    real(wp) :: begin, samples(3)
    integer :: i, r, n

    n = max(1, ceiling(timing%steps*min(1.0_wp, seconds/timing%seconds)))
    do r = 1, size(samples)
      begin = wall_time()
      do i = 1, n
        call evaluate(system, 0.0_wp, breaking=.true.)
      end do
      samples(r) = (wall_time() - begin)/n
    end do
    timing%forces = median(samples)
  end subroutine time_forces

  !> The clocks at every `stride`-th step. No error is set.
  subroutine look_at_clock(observer, system, instant, error)
    class(stopwatch_type), intent(inout) :: observer  !! reads the clocks once more on return if
                                                      !! that is due
    type(system_type), intent(inout) :: system        !! not looked at
    type(instant_type), intent(in) :: instant         !! gives the step
    type(error_type), allocatable, intent(out) :: error

    if (mod(instant%step, observer%stride) /= 0) return
    ! `system` and `error` belong to the interface; a stopwatch has no use for them
    if (allocated(error) .or. size(system%state%u) == 0) return
    observer%n = observer%n + 1
    observer%wall(observer%n) = wall_time()
    observer%processor(observer%n) = processor_time()
  end subroutine look_at_clock

  !> Operations of one directed bond in one step: additions, multiplications, divisions and roots
  !> count one each, a multiply-add two; comparisons and address arithmetic nothing. Counted from
  !> the formulas of the loops as the dimension d enters them; loops whose formulas change must be
  !> counted again.
  !>
  !> Lattice, both loops: eta d, x and e 2(2d - 1), 2x + g e 3, polynomial 15. Dilatation: sum 4.
  !> Force: magnitude 1, direction and sums 4d, with a dilatation 8 more. Where a bond is computed
  !> once for both ends, the sums of the other end are 1 and d more, and all of it is for two
  !> directed bonds. In mixed precision eta is 2d more, the polynomial 4 less. Unprojected, the sum
  !> of the dilatation is 2 less, and what it adds to the force 3.
  !>
  !> List, both loops: eta d, e 4d, projected 2 more, polynomial 15. Dilatation: sum 2, projected 5.
  !> Force: magnitude 2, direction and sums 3d, with a dilatation 5 more, projected 9. Without
  !> stored geometry, both loops: xi d, |xi|^2 2d - 1, root and division 2, weight 3.
  pure real(wp) function flops_of_bond(family, workspace, kind) result(flops)
    class(family_type), intent(in) :: family  !! of lists or of one lattice; any other kind is an
                                              !! internal fault
    type(workspace_type), intent(in) :: workspace  !! of its loops
    integer, intent(in) :: kind  !! of the dilatation, see `dilatation_of`
    real(wp) :: geometry
    integer :: d
    logical :: dilatation

    dilatation = kind /= no_dilatation
    d = family%dim
    select type (family)
    type is (list_family_type)
      geometry = 5*d + 15
      associate (kept => workspace%list)
        if (allocated(kept%shape)) geometry = geometry + (3*d + 4)*count(kept%shape == 0_i8) &
          & /real(max(1, size(kept%shape)), wp)
      end associate
      flops = geometry + 2 + 3*d
      if (dilatation) flops = flops + 5 + geometry + 2
      if (kind == projected) flops = flops + 2 + 4 + 2 + 3
    type is (lattice_family_type)
      geometry = d + 2*(2*d - 1) + 3 + 15
      if (family%mixed) geometry = geometry + 2*d - 4
      flops = geometry + 1 + 4*d
      if (dilatation) flops = flops + 8 + geometry + 4
      if (kind == unprojected) flops = flops - 5
      if (both_ends(d, family%mixed)) flops = (flops + merge(d + 1, d, dilatation))/2
    class default
      flops = 0.0_wp
      call internal_fault('flops_of_bond does not know a kind of family')
    end select
  end function flops_of_bond

  !> Bytes that a step must move between memory and processor at least, if every array is read or
  !> written once by every pass that needs it. Force pass: u, p read, force written; dilatation
  !> pass: u read, p written; motion: force, v, u read, v, u written. Where bonds can break: the
  !> bits read by each pass, the marks written and read. Where loops add to both ends of a bond, the
  !> sums are set to zero and read, and p is made of theta in a loop of its own. In mixed precision
  !> u is split and p rounded, and sums for both ends are set, added to and read. Lists, by each
  !> pass: number and bits of every cluster's members, and what a point has in one place, read and
  !> written with the displacements in it, and read again by the loop; tables of weights, once for
  !> all clusters that share them, and of the geometry.
  pure real(wp) function bytes_of_step(system) result(bytes)
    type(system_type), intent(in) :: system  !! gives dimension, points, bonds and model
    integer :: d, passes
    real(wp) :: points
    logical :: both

    d = system%body%dim
    points = real(system%body%n_points, wp)
    passes = merge(2, 1, system%model%dilatation)
    bytes = points*8*(2*d + 5*d)
    if (system%model%dilatation) bytes = bytes + points*8*(1 + d + 1)
    if (system%model%breaking) bytes = bytes + 2*points
    select type (family => system%family)
    type is (list_family_type)
      bytes = bytes + passes*(11*real(size(family%bits), wp) + points*8*3*8)
      associate (kept => system%workspace%list)
        if (allocated(kept%weight_S)) bytes = bytes + 8*(real(size(kept%weight_S), wp) &
          & + 2*real(size(kept%weight_D), wp))
        if (allocated(kept%geometry)) bytes = bytes + passes*8*real(size(kept%geometry), wp)
      end associate
    type is (lattice_family_type)
      if (system%model%breaking) bytes = bytes + passes*points*8*family%words
      both = both_ends(d, family%mixed)
      if (both) bytes = bytes + points*8*(2*d + merge(3, 0, system%model%dilatation))
      if (family%mixed) then
        bytes = bytes + points*(16*d + merge(8, 0, system%model%dilatation))
        if (both) bytes = bytes + points*16*(d + merge(1, 0, system%model%dilatation))
      end if
    class default
      call internal_fault('bytes_of_step does not know a kind of family')
    end select
  end function bytes_of_step

  !> Memory that a kernel will need while it is built [bytes], on the safe side: what a machine does
  !> not have is better not begun.
  pure real(wp) function bytes_needed(kernel) result(bytes)
    type(kernel_type), intent(in) :: kernel  !! gives dimension, points, family and surface
                                             !! correction
    ! bonds of an inner point at 3.015 spacings: 6, 28, 122
    real(wp), parameter :: bonds(3) = [6.0_wp, 28.0_wp, 122.0_wp]
    real(wp) :: points

    points = real(kernel%points, wp)**kernel%dimension
    bytes = 400*points
    ! 5 bytes of a bond while it is searched; two stored weights where points differ
    if (kernel%family == 'list') bytes = bytes + 5*bonds(kernel%dimension)*points
    if (kernel%generic) bytes = bytes + 14*bonds(kernel%dimension)*points
    if (kernel%family == 'list' .and. kernel%surface) &
      & bytes = bytes + 20*bonds(kernel%dimension)*points
  end function bytes_needed

end module pd_study_bench_kernels
