!> `&refine`: which cells are divided, into what and in which order, what they do to forces, loads,
!> layers and waves, and what is refused.
module test_body_refine
  use bodies, only: at_point, expect_true, shake
  use comparisons, only: expect_close, max_abs
  use pd_base_kinds, only: wp, i1
  use pd_base_text, only: to_text
  use pd_body_body, only: body_type
  use pd_body_refine, only: level_of
  use pd_family_family, only: allocate_bonds, bonds_type
  use pd_force_forces, only: internal_force
  use pd_force_model, only: options_of
  use pd_motion_system, only: system_type
  use pd_set_up_prepare, only: set_up_type
  use perifort, only: answer_type, fault_type => error_type, read_scene_text, run_options_type, &
    & run_scene, scene_type
  use runs, only: ready_text, refuse
  use testdrive, only: check, error_type, new_unittest, test_failed, unittest_type
  use test_scene_expect, only: expect_fault, line
  implicit none (type, external)
  private
  public :: collect_body_refine

  character(*), parameter :: solid = '&material youngs_modulus = 2e11 density = 8e3 '// &
    & 'poissons_ratio = 0.2 /'//line
  character(*), parameter :: relaxes = "&time method = 'relaxation' /"//line
  character(*), parameter :: plate = '&scene dimension = 2 thickness = 1.0 /'//line//solid// &
    & '&body lower = -1, -1 upper = 1, 1 points = 20, 20 /'//line

contains

  subroutine collect_body_refine(testsuite)
    type(unittest_type), allocatable, intent(out) :: testsuite(:)
    testsuite = [ &
      & new_unittest('cells, their order, volume and centre', test_cells), &
      & new_unittest('places by region, expression and shape', test_places), &
      & new_unittest('bonds join neighbouring levels', test_rims), &
      & new_unittest('a hole is cut out of the fine cells', test_hole), &
      & new_unittest('all cells refined are a fine lattice', test_all), &
      & new_unittest('pressure on coarse and fine rows of a side', test_loads), &
      & new_unittest('layers of sides that are not refined', test_layers), &
      & new_unittest('layers of refined sides', test_fine_layers), &
      & new_unittest('a pulse is hardly reflected', test_reflection), &
      & new_unittest('what is refused', test_refusals)]
  end subroutine collect_body_refine

  !> A bar, a plate or a block from 0 to 1.2 m with cells of 0.1 m, refined twice in a ball.
  function box(dim, levels) result(text)
    integer, intent(in) :: dim, levels
    character(:), allocatable :: text
    text = '&scene dimension = '//to_text(dim)//' thickness = 0.5 area = 0.25 /'//line//solid// &
      & '&body lower = 3*0 upper = 3*1.2 points = 3*12 /'//line
    if (dim < 3) text = text(:index(text, '&body') - 1)//'&body lower = '//to_text(dim)// &
      & '*0 upper = '//to_text(dim)//'*1.2 points = '//to_text(dim)//'*12 /'//line
    text = text//"&refine shape = 'sphere' centre = 3*0.62 radius = 0.17 levels = "// &
      & to_text(levels)//' /'//line//'&horizon ratio = 1.5 /'//line//relaxes
  end function box

  !> Each cell with its centre in the ball becomes (2^levels)^dim ones, at the places that those
  !> have; the others keep theirs or, in the rim, are divided less. Volume and centre are those of
  !> the box, to the rounding of some thousand terms; levels follow each other, and each is
  !> sorted by z, y and x.
  subroutine test_cells(error)
    type(error_type), allocatable, intent(out) :: error
    type(set_up_type) :: set_up
    real(wp), parameter :: depths(3) = [0.25_wp, 0.5_wp, 1.0_wp]
    integer :: dim, levels, k, c, s, parts, at, cell(3), number(0:2), level, first(3), other(3)
    real(wp) :: depth, h, centre(3), x(3)
    logical, allocatable :: taken(:, :, :)
    integer, allocatable :: of_cell(:, :, :)

    do dim = 1, 3
      do levels = 1, 2
        call ready_text(box(dim, levels), set_up, error)
        if (allocated(error)) return
        depth = depths(dim)
        associate (body => set_up%system%body)
          parts = 2**levels
          if (allocated(taken)) deallocate (taken, of_cell)
          allocate (taken(12*parts, 12*parts, 12*parts), source=.false.)
          allocate (of_cell(12, 12, 12), source=-1)
          number = 0
          do k = 1, body%n_points
            s = body%slot(k)
            level = level_of(body, s)
            number(level) = number(level) + 1
            h = 0.1_wp/2**level
            call expect_close(error, [body%spacing(s), body%volume(s)], [h, depth*h**dim], &
              & 1.0e-14_wp, 'spacing and volume')
            ! its cell in the finest grid: all that it covers were free
            first = 1
            other = 1
            cell = 1
            do c = 1, dim
              at = nint(body%x(s, c)/h + 0.5_wp)
              call expect_close(error, body%x(s, c), (at - 0.5_wp)*h, 1.0e-14_wp, 'place')
              cell(c) = (at - 1)/2**level + 1
              first(c) = (at - 1)*parts/2**level + 1
              other(c) = at*parts/2**level
            end do
            call check(error, .not. any(taken(first(1):other(1), first(2):other(2), &
              & first(3):other(3))), 'two points share a cell')
            if (allocated(error)) return
            taken(first(1):other(1), first(2):other(2), first(3):other(3)) = .true.
            associate (there => of_cell(cell(1), cell(2), cell(3)))
              call check(error, there == -1 .or. there == level, 'a cell of two levels')
              there = level
            end associate
            if (k == 1) cycle
            call check(error, follows(body, int(body%slot(k - 1)), s), 'the order of points')
            if (allocated(error)) return
          end do
          do k = 0, 12**dim - 1
            cell = [mod(k, 12), mod(k/12, 12), k/144] + 1
            x = 0.62_wp
            x(:dim) = (cell(:dim) - 0.5_wp)*0.1_wp
            call check(error, of_cell(cell(1), cell(2), cell(3)) == levels &
              & .eqv. norm2(x(:dim) - 0.62_wp) <= 0.17_wp, 'which cells are divided')
            if (allocated(error)) return
          end do
          call check(error, all(number(:levels) > 0), 'a level without points')
          call expect_close(error, sum(body%volume), depth*1.2_wp**dim, 1.0e-12_wp, 'volume')
          do c = 1, dim
            centre(c) = sum(body%volume*body%x(:, c))/sum(body%volume)
          end do
          call expect_close(error, centre(:dim), 0.6_wp, 1.0e-12_wp, 'centre')
        end associate
        if (allocated(error)) return
      end do
    end do
  end subroutine test_cells

  !> Whether point `b` may follow `a`: a finer level, or the next along x, then y, then z.
  logical function follows(body, a, b)
    type(body_type), intent(in) :: body
    integer, intent(in) :: a, b
    integer :: c

    follows = level_of(body, b) > level_of(body, a)
    if (level_of(body, b) /= level_of(body, a)) return
    do c = body%dim, 1, -1
      if (abs(body%x(b, c) - body%x(a, c)) < 0.1_wp*body%spacing(a)) cycle
      follows = body%x(b, c) > body%x(a, c)
      return
    end do
  end function follows

  subroutine test_places(error)
    type(error_type), allocatable, intent(out) :: error

    call expect_fine("&refine shape = 'box' lower(1) = 0.5 /", 100)
    call expect_fine("&refine where = '(x > 0.5)*(y > 0)' /", 50)
    call expect_fine("&region name = 'r' shape = 'box' lower(1) = 0.5 /"//line// &
      & "&refine region = 'r' where = 'y > 0' /", 50)
    call expect_fine("&refine shape = 'box' lower(1) = 0.5 /"//line// &
      & "&refine shape = 'box' lower = -1, 0 /", 250)

  contains

    !> The number of cells of the plate that are divided in four.
    subroutine expect_fine(text, cells)
      character(*), intent(in) :: text
      integer, intent(in) :: cells
      type(set_up_type) :: set_up

      call ready_text(plate//relaxes//text, set_up, error)
      if (.not. allocated(error)) call check(error, set_up%system%body%n_points, 400 + 3*cells, &
        & text)
    end subroutine expect_fine

  end subroutine test_places

  !> Between level 2 and level 0 lies a rim that no bond crosses, whatever the ratio.
  subroutine test_rims(error)
    type(error_type), allocatable, intent(out) :: error
    character(5), parameter :: ratios(3) = [character(5) :: '1.5', '2.015', '3.015']
    type(set_up_type) :: set_up
    type(bonds_type) :: bonds
    integer :: r, k, i, joined

    do r = 1, size(ratios)
      call ready_text(plate//relaxes//'&horizon ratio = '//trim(ratios(r))//' /'//line// &
        & "&refine shape = 'sphere' radius = 0.25 levels = 3 /", set_up, error)
      if (allocated(error)) return
      associate (body => set_up%system%body, family => set_up%system%family)
        call allocate_bonds(family, bonds)
        joined = 0
        do k = 1, body%n_slots
          if (body%point(k) == 0) cycle
          call family%bonds_of(k, bonds)
          do i = 1, bonds%n
            associate (step => abs(level_of(body, k) - level_of(body, int(bonds%j(i)))))
              call check(error, step <= 1, 'a bond joins levels that are no neighbours')
              if (allocated(error)) return
              joined = joined + step
            end associate
          end do
        end do
      end associate
      call expect_true(error, joined > 100, 'too few bonds join levels')
    end do
  end subroutine test_rims

  !> The area of a hole is that of the fine cells with their centres in it.
  subroutine test_hole(error)
    type(error_type), allocatable, intent(out) :: error
    type(set_up_type) :: set_up
    integer :: i, j, cells

    call ready_text(plate//relaxes//"&refine shape = 'sphere' radius = 0.5 levels = 2 /"//line// &
      & "&remove shape = 'sphere' radius = 0.301 /", set_up, error)
    if (allocated(error)) return
    cells = 0
    do j = 1, 80
      do i = 1, 80
        if (norm2(([i, j] - 40.5_wp)*0.025_wp) <= 0.301_wp) cells = cells + 1
      end do
    end do
    call expect_close(error, sum(set_up%system%body%volume), 4 - cells*0.025_wp**2, 1.0e-12_wp, &
      & 'volume')
  end subroutine test_hole

  !> Forces of the same lattice, made at once.
  subroutine test_all(error)
    type(error_type), allocatable, intent(out) :: error
    type(set_up_type) :: one, other
    real(wp), allocatable :: u(:, :), v(:, :), force(:, :), expected(:, :)
    real(wp) :: gradient(3, 3)
    integer :: k, j

    call ready_text(plate//relaxes//"&refine where = '1' /", one, error)
    call ready_text('&scene dimension = 2 thickness = 1.0 /'//line//solid// &
      & '&body lower = -1, -1 upper = 1, 1 points = 40, 40 /'//line//relaxes, other, error)
    if (allocated(error)) return
    call check(error, one%system%body%n_points, 1600)
    if (allocated(error)) return
    allocate (v(other%system%body%n_slots, 2), u(one%system%body%n_slots, 2), source=0.0_wp)
    gradient = 1.0e-3_wp
    call shake(other%system%body, gradient, 1.0e-5_wp, 7, v)
    do k = 1, one%system%body%n_slots
      if (one%system%body%point(k) == 0) cycle
      u(k, :) = v(at_point(other%system%body, one%system%body%x(k, :)), :)
    end do
    call force_at(one%system, u, force)
    call force_at(other%system, v, expected)
    do k = 1, one%system%body%n_slots
      if (one%system%body%point(k) == 0) cycle
      j = at_point(other%system%body, one%system%body%x(k, :))
      call expect_close(error, force(k, :), expected(j, :), 1.0e-11_wp*max_abs(expected), 'force')
      if (allocated(error)) return
    end do
  end subroutine test_all

  subroutine force_at(system, u, force)
    type(system_type), intent(inout) :: system
    real(wp), intent(in), contiguous :: u(:, :)
    real(wp), allocatable, intent(out) :: force(:, :)
    real(wp), allocatable :: p(:)
    integer(i1), allocatable :: strained(:)

    allocate (force(size(u, 1), size(u, 2)), p(size(u, 1)), source=0.0_wp)
    allocate (strained(size(u, 1)), source=0_i1)
    call internal_force(system%body, system%family, system%model, options_of(system%model), &
      & system%workspace, u, p, force, strained)
  end subroutine force_at

  !> A plate refined at a part of its side, under pressure there and a force on the other side. The
  !> loads balance, or a plate without supports would be refused: the pressure acts on the area of
  !> the side, whatever the rows. The energy in static equilibrium is half the work, and that of the
  !> plate without refinement within 1 %.
  subroutine test_loads(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp) :: plain, refined

    call energy_of('', plain)
    call energy_of("&refine shape = 'box' lower = 0.5, -0.3 upper = 1, 0.4 /"//line, refined)
    if (allocated(error)) return
    call expect_close(error, refined, plain, 0.01_wp*plain, 'strain energy')

  contains

    subroutine energy_of(refinement, energy)
      character(*), intent(in) :: refinement
      real(wp), intent(out) :: energy
      type(scene_type) :: scene
      type(answer_type) :: answer
      type(fault_type), allocatable :: fault
      real(wp), allocatable :: strain(:), work(:)

      energy = 0.0_wp
      if (allocated(error)) return
      call read_scene_text(plate//relaxes//refinement// &
        & "&load side = 'x_max' pressure = -1e6 /"//line// &
        & "&load side = 'x_min' force_x = -2e6 /"//line//"&output fields = 'displacement' /", &
        & '', scene, fault)
      if (.not. allocated(fault)) call run_scene(scene, run_options_type(quiet=.true., &
        & files=.false.), fault, answer=answer)
      if (.not. allocated(fault)) call answer%get_column('strain_energy', strain, fault)
      if (.not. allocated(fault)) call answer%get_column('external_work', work, fault)
      if (allocated(fault)) then
        call test_failed(error, fault%message)
        return
      end if
      energy = strain(size(strain))
      call expect_close(error, energy/work(size(work)), 1.0_wp, 1.0e-4_wp, 'energy over work')
    end subroutine energy_of

  end subroutine test_loads

  !> Layers join unrefined sides, two at once.
  subroutine test_layers(error)
    type(error_type), allocatable, intent(out) :: error
    character(*), parameter :: refined = "&refine shape = 'box' lower = 0.5, -0.3 upper = 1, 0.4 /"
    type(set_up_type) :: set_up

    call ready_text(plate//relaxes//refined//line// &
      & "&boundary side = 'y_min' displacement_y = 0 /"//line// &
      & "&boundary side = 'y_max' displacement_y = 1e-6 /", set_up, error)
    if (allocated(error)) return
    associate (body => set_up%system%body)
      call check(error, count(body%layer == 1 .and. body%point > 0), 60, 'first layer')
      if (.not. allocated(error)) call check(error, count(body%layer == 2 .and. body%point > 0), &
        & 60, 'second layer')
    end associate
  end subroutine test_layers

  !> A layer takes spacing and horizon from the rows that it joins: three rows of 0.1 m before
  !> coarse columns, three of 0.05 m before fine ones. Fine cells behind coarse ones change nothing.
  subroutine test_fine_layers(error)
    type(error_type), allocatable, intent(out) :: error
    character(*), parameter :: pulled = "&boundary name = 'right' side = 'x_max' "// &
      & 'displacement_x = 1e-6 /'//line//"&boundary name = 'left' side = 'x_min' "// &
      & 'displacement_x = 0 /'//line
    type(set_up_type) :: set_up
    real(wp), allocatable :: depth(:)

    call ready_text(plate//relaxes//pulled// &
      & "&refine shape = 'box' lower = 0.5, -0.3 upper = 1, 0.4 /", set_up, error)
    if (allocated(error)) return
    associate (body => set_up%system%body)
      call check(error, count(body%layer == 1 .and. body%spacing > 0.07_wp), 13*3, 'coarse layer')
      if (.not. allocated(error)) call check(error, count(body%layer == 1 .and. &
        & body%spacing < 0.07_wp), 14*3, 'fine layer')
      if (.not. allocated(error)) call check(error, count(body%layer == 2), 60, 'the other side')
      if (allocated(error)) return
      ! each in the three rows before the side, and none behind another
      depth = (pack(body%x(:, 1), body%layer == 1) - 1)/pack(body%spacing, body%layer == 1)
      call expect_close(error, minval(depth), 0.5_wp, 1.0e-9_wp, 'the first row')
      call expect_close(error, maxval(depth), 2.5_wp, 1.0e-9_wp, 'the last row')
      call expect_close(error, sum(body%volume, mask=body%layer == 1), &
        & 13*3*0.1_wp**2 + 14*3*0.05_wp**2, 1.0e-12_wp, 'volume')
      call expect_true(error, all(abs(pack(body%x(:, 2), body%layer == 1 .and. &
        & body%spacing < 0.07_wp) - 0.05_wp) < 0.35_wp), 'columns of the fine layer')
    end associate
    ! a corner that is cut: cells that both layers reach for belong to the earlier one
    call ready_text(plate//relaxes//"&refine shape = 'box' lower = 0.5, 0.5 levels = 2 /"//line// &
      & "&remove shape = 'box' lower = 0.81, 0.81 /"//line// &
      & "&boundary side = 'x_max' displacement_x = 0 /"//line// &
      & "&boundary side = 'y_max' displacement_y = 0 /", set_up, error)
    if (allocated(error)) return
    call expect_true(error, minval(set_up%system%body%spacing, mask=set_up%system%body%layer == 2) &
      & < 0.03_wp, 'no layer at the refined corner')
    call pulled_plate(error, '', 0.0_wp)
    call pulled_plate(error, "&refine shape = 'box' lower = 0.4, -0.3 levels = 2 /"//line, 0.02_wp)

  contains

    !> Reactions of both sides are in balance, the energy is half of what the moved side has done,
    !> and both are those of the plate without finer cells within `tolerance`: a layer holds about
    !> half a spacing outside of its face, and 0.04 m of 2 m are that much less.
    subroutine pulled_plate(error, refinement, tolerance)
      type(error_type), allocatable, intent(inout) :: error
      character(*), intent(in) :: refinement
      real(wp), intent(in) :: tolerance
      type(scene_type) :: scene
      type(answer_type) :: answer
      type(fault_type), allocatable :: fault
      real(wp), allocatable :: strain(:), left(:), right(:)
      real(wp), save :: expected = 0.0_wp

      if (allocated(error)) return
      call read_scene_text(plate//relaxes//pulled//refinement// &
        & "&output fields = 'displacement' /", '', scene, fault)
      if (.not. allocated(fault)) call run_scene(scene, run_options_type(quiet=.true., &
        & files=.false.), fault, answer=answer)
      if (.not. allocated(fault)) call answer%get_column('strain_energy', strain, fault)
      if (.not. allocated(fault)) call answer%get_column('left_reaction_x', left, fault)
      if (.not. allocated(fault)) call answer%get_column('right_reaction_x', right, fault)
      if (allocated(fault)) then
        call test_failed(error, fault%message)
        return
      end if
      associate (n => size(strain))
        call expect_close(error, left(n), -right(n), 1.0e-5_wp*abs(right(n)), 'balance')
        call expect_close(error, strain(n), right(n)*0.5e-6_wp, 1.0e-4_wp*strain(n), 'energy')
        if (tolerance > 0.0_wp) call expect_close(error, right(n), expected, &
          & tolerance*expected, 'reaction')
        expected = right(n)
      end associate
    end subroutine pulled_plate

  end subroutine test_fine_layers

  !> A pulse of displacement, 20 coarse spacings long, runs into a part of half the spacing. What
  !> comes back, the difference to a bar of the coarse spacing, is 1.5 % of it (measured), of which
  !> the two horizons alone have a part: short waves are slower in the longer one.
  subroutine test_reflection(error)
    type(error_type), allocatable, intent(out) :: error
    character(*), parameter :: bar = '&scene dimension = 1 area = 1.0 /'//line// &
      & '&material youngs_modulus = 1.0 density = 1.0 /'//line// &
      & '&body lower = 0 upper = 1 points = 400 /'//line// &
      & "&define name = 'k' value = '40*pi' /"//line// &
      & "&initial displacement_x = '(abs(x - 0.2) < 0.025)*1e-5*(1 + cos(k*(x - 0.2)))' "// &
      & "velocity_x = '(abs(x - 0.2) < 0.025)*1e-5*k*sin(k*(x - 0.2))' /"//line// &
      & "&time duration = 0.5 safety = 0.5 /"//line//"&output fields = 'displacement' /"//line
    real(wp), allocatable :: refined(:, :), plain(:, :)
    integer :: n

    call displacements(bar//"&refine shape = 'box' lower = 0.5 /", refined)
    call displacements(bar, plain)
    if (allocated(error)) return
    ! the coarse points come first
    n = 180
    call expect_true(error, max_abs(plain) > 1.5e-5_wp, 'no pulse')
    call expect_close(error, refined(:n, 1), plain(:n, 1), 0.02_wp*max_abs(plain), 'reflected')
    call expect_true(error, max_abs(refined(:n, 1) - plain(:n, 1)) > 0.001_wp*max_abs(plain), &
      & 'nothing comes back: are the horizons different?')

  contains

    subroutine displacements(text, u)
      character(*), intent(in) :: text
      real(wp), allocatable, intent(out) :: u(:, :)
      type(scene_type) :: scene
      type(answer_type) :: answer
      type(fault_type), allocatable :: fault

      if (allocated(error)) return
      call read_scene_text(text, '', scene, fault)
      if (.not. allocated(fault)) call run_scene(scene, run_options_type(quiet=.true., &
        & files=.false.), fault, answer=answer)
      if (.not. allocated(fault)) call answer%get_field('displacement', u, fault)
      if (allocated(fault)) call test_failed(error, fault%message)
    end subroutine displacements

  end subroutine test_reflection

  subroutine test_refusals(error)
    type(error_type), allocatable, intent(out) :: error
    character(*), parameter :: ball = "&refine shape = 'sphere' radius = 0.5 /"//line

    call expect_fault(error, plate//relaxes//'&refine levels = 2 /', &
      & "group &refine lacks the key 'shape'")
    call expect_fault(error, plate//relaxes//"&refine shape = 'sphere' radius = 0.5 levels = 9 /", &
      & '9 levels|there may be 8')
    call expect_fault(error, plate//relaxes//ball//'&horizon length = 0.3 /', &
      & "'length' is given with &refine|give 'ratio'")
    call expect_fault(error, '&scene dimension = 2 thickness = 1.0 /'//line//solid//relaxes// &
      & ball//"&body shape = 'sphere' radius = 1 spacing = 0.1 /", &
      & '&refine in a scene whose body number 1 is no lattice|cut them out of a box by &keep')
    call refuse(error, plate//relaxes//"&refine shape = 'sphere' centre = 5, 0 radius = 0.5 /", &
      & '&refine number 1 refines no cell')
    call refuse(error, '&scene dimension = 3 /'//line//solid//relaxes// &
      & '&body lower = 3*0 upper = 3*1 points = 3*20 /'//line//"&refine where = '1' levels = 6 /", &
      & 'refined cells make more than 1000000000 points')
  end subroutine test_refusals

end module test_body_refine
