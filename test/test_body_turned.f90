!> Turned lattices: their answers are the turned ones of lattices along x, y and z.
module test_body_turned
  use pd_base_error, only: fault_type => error_type
  use pd_base_kinds, only: wp
  use pd_base_text, only: to_text
  use pd_body_body, only: body_type
  use pd_body_generate, only: generate_body
  use pd_body_lattices, only: axes_of
  use pd_driver, only: run_scene
  use pd_output_report_begin, only: run_options_type
  use pd_output_results_answer, only: answer_type
  use pd_scene_content_types, only: scene_type
  use bodies, only: expect_true
  use comparisons, only: expect_close, max_abs
  use test_scene_expect, only: expect_fault, expect_parts, expect_scene, line
  use testdrive, only: error_type, new_unittest, test_failed, unittest_type
  implicit none (type, external)
  private
  public :: collect_body_turned

  character(*), parameter :: steel = '&material youngs_modulus = 2e11 density = 7850 '// &
    & 'poissons_ratio = 0.3 /'//line
  character(*), parameter :: plane = '&scene dimension = 2 /'//line//steel, &
    & space = '&scene dimension = 3 /'//line//steel
  character(*), parameter :: bar_2d = "&body name = 'bar' lower = 0.1 0.2 upper = 1.3 0.7 "// &
    & 'points = 24 10', bar_3d = "&body name = 'bar' lower = 0.1 0.2 0.3 upper = 1.3 0.6 0.7 "// &
    & 'points = 12 4 4'
  character(*), parameter :: axes_2d = ' axis_1 = 3 4', axes_3d = ' axis_1 = 1 2 2 axis_2 = 1 0 1'
  character(*), parameter :: pull = "&boundary body = 'bar' side = 'x_min' displacement_x = 0 "// &
    & "displacement_y = 0 DISPLACEMENT_Z &load body = 'bar' side = 'x_max' pressure = -1e8 /"//line
  character(*), parameter :: wave = '&time steps = 60 /'//line, &
    & still = "&time method = 'relaxation' /"//line//'&relaxation tolerance = 1e-13 /'//line

contains

  subroutine collect_body_turned(testsuite)
    type(unittest_type), allocatable, intent(out) :: testsuite(:)
    testsuite = [ &
      & new_unittest('axes are a frame', test_axes), &
      & new_unittest('points, layers and shapes turn', test_points), &
      & new_unittest('a turned bar under tension', test_bar), &
      & new_unittest('bodies that are turned differently', test_overlap), &
      & new_unittest('what turned bodies do not have', test_refused)]
  end subroutine collect_body_turned

  subroutine test_axes(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    real(wp) :: axes(3, 3), identity(3, 3)
    integer :: c

    identity = 0.0_wp
    do c = 1, 3
      identity(c, c) = 1.0_wp
    end do
    call expect_scene(error, space//bar_3d//axes_3d//' /'//line//wave, scene)
    if (allocated(error)) return
    axes = axes_of(scene%bodies(1), 3)
    call expect_close(error, matmul(transpose(axes), axes), identity, 1.0e-15_wp, 'orthonormal')
    call expect_close(error, axes(:, 1), [1.0_wp, 2.0_wp, 2.0_wp]/3, 1.0e-15_wp, 'first rows')
    ! (1, 0, 1) without its part of 1 along (1, 2, 2)/3 is (2, -2, 1)/3
    call expect_close(error, axes(:, 2), [2.0_wp, -2.0_wp, 1.0_wp]/3, 1.0e-15_wp, 'second rows')
    call expect_close(error, axes(:, 3), [2.0_wp, 1.0_wp, -2.0_wp]/3, 1.0e-15_wp, 'third rows')
    call expect_scene(error, plane//bar_2d//axes_2d//' /'//line//wave, scene)
    if (allocated(error)) return
    axes = axes_of(scene%bodies(1), 2)
    call expect_close(error, axes(:2, 2), [-0.8_wp, 0.6_wp], 1.0e-15_wp, 'turned left')
  end subroutine test_axes

  subroutine test_points(error)
    type(error_type), allocatable, intent(out) :: error
    character(*), parameter :: layers = "&boundary side = 'y_max' displacement_x = 0 /"//line// &
      & "&boundary side = 'x_min' displacement_x = 0 /"//line
    character(*), parameter :: rod = "&body shape = 'cylinder' centre = 1 2 3 radius = 0.5 "// &
      & 'height = 1 spacing = 0.1'

    call compare_points(error, plane//bar_2d, axes_2d, ' /'//line//wave//layers, [0.1_wp, 0.2_wp], &
      & 'layers of a plane')
    call compare_points(error, space//bar_3d, axes_3d, ' /'//line//wave//layers, [0.1_wp, 0.2_wp, &
      & 0.3_wp], 'layers in space')
    call compare_points(error, space//rod, axes_3d, &
      & ' /'//line//wave//"&boundary side = 'z_min' "// &
      & 'displacement_x = 0 /'//line, [1.0_wp, 2.0_wp, 3.0_wp], 'a cylinder')
  end subroutine test_points

  !> Points with and without axes: the first are the second ones, turned about `about`.
  subroutine compare_points(error, before, axes, after, about, what)
    type(error_type), allocatable, intent(inout) :: error
    character(*), intent(in) :: before, axes, after, what
    real(wp), intent(in) :: about(:)
    type(scene_type) :: scene
    type(body_type) :: straight, turned
    type(fault_type), allocatable :: fault
    real(wp) :: delta, frame(3, 3)
    integer :: k

    call expect_scene(error, before//after, scene)
    if (allocated(error)) return
    call generate_body(scene, straight, delta, fault)
    call expect_scene(error, before//axes//after, scene)
    if (allocated(error)) return
    if (.not. allocated(fault)) call generate_body(scene, turned, delta, fault)
    if (allocated(fault)) then
      call test_failed(error, what//': '//fault%message)
      return
    end if
    frame = axes_of(scene%bodies(1), size(about))
    call expect_true(error, straight%n_points == turned%n_points .and. any(straight%layer > 0), &
      & what//': '//to_text(turned%n_points)//' points')
    if (allocated(error)) return
    call expect_true(error, all(straight%layer == turned%layer), what//': layers')
    do k = 1, straight%n_points
      call expect_close(error, turned%x(k, :), about + matmul(frame(:size(about), :size(about)), &
        & straight%x(k, :) - about), 1.0e-13_wp, what//': point '//to_text(k))
    end do
  end subroutine compare_points

  !> The displacements of a turned bar are the turned ones, moving and at rest, on lattices with and
  !> without surface correction and on lists.
  subroutine test_bar(error)
    type(error_type), allocatable, intent(out) :: error

    call compare_answers(error, 2, wave, '&horizon /'//line, 'plane, energy')
    call compare_answers(error, 3, wave, '&horizon ratio = 2.015 /'//line, 'space, energy')
    call compare_answers(error, 2, still, "&horizon volume_correction = 'exact' /"//line, &
      & 'plane at rest')
    call compare_answers(error, 3, still, '&horizon ratio = 2.015 /'//line, 'space at rest')
    call compare_answers(error, 2, wave, "&horizon family = 'list' surface_correction = 'none' "// &
      & "/"// &
      & line, 'plane, lists')
    call compare_answers(error, 3, wave, "&horizon ratio = 2.015 family = 'list' "// &
      & "surface_correction = 'none' /"//line, 'space, lists')
  end subroutine test_bar

  subroutine compare_answers(error, dim, motion, horizon, what)
    type(error_type), allocatable, intent(inout) :: error
    integer, intent(in) :: dim
    character(*), intent(in) :: motion, horizon, what
    real(wp), allocatable :: straight(:, :), turned(:, :)
    real(wp) :: frame(3, 3)
    character(:), allocatable :: body, ground
    integer :: at

    at = index(pull, 'DISPLACEMENT_Z')
    ground = pull(:at - 1)//trim(merge('displacement_z = 0 /', '/                   ', dim == &
      & 3))// &
      & line//pull(at + 15:)
    body = plane//bar_2d
    if (dim == 3) body = space//bar_3d
    call answer_of(error, body//' /'//line//ground//motion//horizon, dim, straight, frame)
    call answer_of(error, body//trim(merge(axes_3d, axes_2d//repeat(' ', len(axes_3d) &
      & - len(axes_2d)), dim == 3))//' /'//line//ground//motion//horizon, dim, turned, frame)
    if (allocated(error)) return
    call expect_true(error, max_abs(straight) > 1.0e-6_wp, what//': it moves')
    call expect_close(error, turned, matmul(straight, transpose(frame)), &
      & 1.0e-10_wp*max_abs(straight), what)
  end subroutine compare_answers

  !> The displacements at the end of a run.
  subroutine answer_of(error, text, dim, u, frame)
    type(error_type), allocatable, intent(inout) :: error
    character(*), intent(in) :: text
    integer, intent(in) :: dim
    real(wp), allocatable, intent(out) :: u(:, :)
    real(wp), intent(out) :: frame(3, 3)
    type(scene_type) :: scene
    type(run_options_type) :: options
    type(answer_type) :: answer
    type(fault_type), allocatable :: fault

    call expect_scene(error, text, scene)
    if (allocated(error)) return
    frame = axes_of(scene%bodies(1), dim)
    options%files = .false.
    options%quiet = .true.
    options%threads = 2
    call run_scene(scene, options, fault, answer=answer)
    if (.not. allocated(fault)) call answer%get_field('displacement', u, fault)
    if (allocated(fault)) call test_failed(error, fault%message)
  end subroutine answer_of

  !> Two plates side by side, both turned about one corner, touch; with one turned farther they
  !> overlap, and turned away they do not.
  subroutine test_overlap(error)
    type(error_type), allocatable, intent(out) :: error
    character(*), parameter :: one = '&body lower = 0 0 upper = 1 1 points = 10 10 ', &
      & other = '&body lower = 0 0 upper = 1 1 points = 10 10 '
    character(*), parameter :: rest = ' /'//line//wave//"&horizon surface_correction = 'none' "// &
      & "/"//line

    call expect_overlap(error, plane//one//'axis_1 = 1 1 /'//line//other//'axis_1 = -1 1'//rest, &
      & .false.)
    call expect_overlap(error, plane//one//'axis_1 = 1 1 /'//line//other//'axis_1 = 0 1'//rest, &
      & .true.)
    call expect_overlap(error, plane//one//'/'//line//other//'axis_1 = -1 -1'//rest, .false.)
    call expect_overlap(error, plane//one//'/'//line//other//'axis_1 = -1 2'//rest, .false.)
    call expect_overlap(error, plane//one//'/'//line//other//'axis_1 = 1 1'//rest, .true.)
  end subroutine test_overlap

  subroutine expect_overlap(error, text, overlaps)
    type(error_type), allocatable, intent(inout) :: error
    character(*), intent(in) :: text
    logical, intent(in) :: overlaps
    type(scene_type) :: scene
    type(body_type) :: body
    type(fault_type), allocatable :: fault
    real(wp) :: delta

    call expect_scene(error, text, scene)
    if (allocated(error)) return
    call generate_body(scene, body, delta, fault)
    call expect_true(error, allocated(fault) .eqv. overlaps, 'overlap of '//text)
    if (.not. allocated(error) .and. overlaps) call expect_parts(error, fault, 'overlap')
  end subroutine expect_overlap

  subroutine test_refused(error)
    type(error_type), allocatable, intent(out) :: error
    character(*), parameter :: bar = plane//bar_2d//axes_2d//' /'//line//wave
    character(*), parameter :: second = '&body lower = 5 5 upper = 6 6 points = 20 20 /'//line
    type(scene_type) :: scene
    type(run_options_type) :: options
    type(fault_type), allocatable :: fault

    call expect_fault(error, plane//bar_2d//axes_3d//' /'//line//wave, "'axis_1' has too many|:3")
    call expect_fault(error, plane//bar_2d//axes_2d//' axis_2 = 1 0 /'//line//wave, &
      & "'axis_2' in a scene of dimension 2|turned left|:3")
    call expect_fault(error, space//bar_3d//' axis_1 = 1 0 0 /'//line//wave, &
      & "lacks the key 'axis_2'|:3")
    call expect_fault(error, space//bar_3d//' axis_1 = 1 2 3 axis_2 = -2 -4 -6 /'//line//wave, &
      & 'are parallel or zero|:3')
    call expect_fault(error, bar//"&horizon surface_correction = 'consistent' /"//line, &
      & "a turned body with surface_correction = 'consistent'|a/b.nml:3")
    call expect_fault(error, bar//second//"&load side = 'x_max' pressure = 1 /"//line, &
      & "a side of all bodies|name it by 'body'|a/b.nml:6")
    call expect_fault(error, bar//"&boundary side = 'x_max' absorbing = .true. /"//line, &
      & 'an absorbing boundary in a scene with a turned body|a/b.nml:5')
    ! the factors of the energy need one frame, and lattices
    options%files = .false.
    options%quiet = .true.
    call expect_scene(error, bar//second, scene)
    if (.not. allocated(error)) call run_scene(scene, options, fault)
    if (.not. allocated(error)) call expect_parts(error, fault, &
      & "'energy'|the axes of bodies 1 and 2 differ|a/b.nml:3")
    call expect_scene(error, bar//"&horizon family = 'list' /"//line, scene)
    if (.not. allocated(error)) call run_scene(scene, options, fault)
    if (.not. allocated(error)) call expect_parts(error, fault, "'energy'|lists|a/b.nml:3")
  end subroutine test_refused

end module test_body_turned
