!> Slabs of lattices: what threads may work on at once.
module test_family_slabs
  use omp_lib, only: omp_get_max_threads, omp_set_num_threads
  use pd_base_kinds, only: wp, i1, i8
  use pd_base_lanes, only: lanes
  use pd_base_error, only: fault_type => error_type
  use pd_body_body, only: body_type, owned
  use pd_body_division, only: divide_space, division_type
  use pd_body_survey, only: survey_points, survey_type
  use pd_body_windows, only: begin_work, make_part, work_of_windows
  use pd_body_work, only: work_rule_type
  use pd_set_up_prepare, only: set_up_type
  use pd_set_up_ranks, only: rule_of_work
  use pd_family_family, only: allocate_bonds, bonds_type
  use pd_family_lattice, only: grid_at, lattice_family_type, new_lattice_family
  use pd_family_volume, only: reach, volume_rule_number, volume_rule_type
  use pd_force_forces, only: internal_force
  use pd_force_model, only: options_of
  use pd_force_reference, only: reference_force
  use pd_motion_system, only: system_type
  use pd_scene_content_types, only: scene_type
  use comparisons, only: expect_close, max_abs
  use testdrive, only: error_type, new_unittest, test_failed, unittest_type
  use bodies, only: box_scene, expect, expect_true, ready, shake, text_of
  use force_subjects, only: some_gradient
  implicit none (type, external)
  private
  public :: collect_family_slabs

  real(wp), parameter :: spacing = 1.0e-3_wp  !! [m]

  !> Bodies that must be cut across each of their axes: many points along one, few along the others.
  integer, parameter :: shapes(3, 4) = reshape([24, 24, 40, 9, 70, 5, 200, 4, 4, 65, 40, 3], [3, 4])

contains

  subroutine collect_family_slabs(testsuite)
    type(unittest_type), allocatable, intent(out) :: testsuite(:)
    testsuite = [ &
      & new_unittest('slabs of one colour never add to the same slot', test_apart), &
      & new_unittest('every block lies in one slab', test_whole), &
      & new_unittest('blocks that need copies of other points come late', test_late), &
      & new_unittest('loops that add to both ends give the same bits on any number of threads', &
      & test_threads), &
      & new_unittest('bonds on either side of the fast formula are added once', test_once)]
  end subroutine collect_family_slabs

  !> A box of `points`, ready; with `twice` a second one far away.
  subroutine box(points, breaking, twice, set_up, error)
    integer, intent(in) :: points(:)
    logical, intent(in) :: breaking, twice
    type(set_up_type), intent(out) :: set_up
    type(error_type), allocatable, intent(inout) :: error
    type(scene_type) :: scene

    call box_scene(points, spacing, 0.3_wp, scene)
    scene%horizon%family = 'lattice'
    if (breaking) scene%materials(1)%critical_stretch = 0.06_wp
    if (twice) then
      scene%bodies = [scene%bodies(1), scene%bodies(1)]
      scene%bodies(2)%name = 'other'
      scene%bodies(2)%lower(3) = 2*scene%bodies(1)%upper(3) + spacing/3
      scene%bodies(2)%upper(3) = scene%bodies(2)%lower(3) + scene%bodies(1)%upper(3)
    end if
    call ready(scene, set_up, error)
  end subroutine box

  !> The loops add to the slots of a block and to those one forward offset away. Every slot is noted
  !> with the slab that adds to it.
  subroutine test_apart(error)
    type(error_type), allocatable, intent(out) :: error
    type(set_up_type) :: set_up
    integer :: shape, colour

    do shape = 1, size(shapes, 2)
      call box(shapes(:, shape), .false., shape == 1, set_up, error)
      if (allocated(error)) return
      select type (family => set_up%system%family)
      type is (lattice_family_type)
        do colour = 1, 2
          associate (first => family%slabs%colour)
            call expect_true(error, first(colour + 1) - first(colour) > 1, &
              & 'only one slab of a colour in shape '//text_of(real(shape, wp)))
          end associate
          call keep_apart(family, colour, error)
        end do
      class default
        call test_failed(error, 'not a lattice')
      end select
    end do
  end subroutine test_apart

  !> Each slot gets something from one slab of a colour at most.
  subroutine keep_apart(family, colour, error)
    type(lattice_family_type), intent(in) :: family
    integer, intent(in) :: colour
    type(error_type), allocatable, intent(inout) :: error
    integer, allocatable :: owner(:)
    integer :: s, b, o

    owner = [(0, s=1, family%n_slots)]
    do s = family%slabs%colour(colour), family%slabs%colour(colour + 1) - 1
      do b = family%slabs%first(s), family%slabs%first(s + 1) - 1
        call claim(family%block(b))
        associate (grid => family%grids(grid_at(family, family%block(b))))
          do o = 1, grid%n
            ! the loops leave out offsets that none of the block's slots has
            if (grid%shift(o) > 0 .and. any(family%alive(family%block(b):family%block(b) &
              & + lanes - 1) == 1_i1 .and. family%alive(family%block(b) + grid%shift(o): &
              & family%block(b) + grid%shift(o) + lanes - 1) == 1_i1)) &
              & call claim(family%block(b) + grid%shift(o))
          end do
        end associate
        if (allocated(error)) return
      end do
    end do

  contains

    subroutine claim(first)
      integer(i8), intent(in) :: first
      if (any(owner(first:first + lanes - 1) /= 0 .and. owner(first:first + lanes - 1) /= s)) &
        & call expect_true(error, .false., 'two slabs of one colour add to one slot')
      owner(first:first + lanes - 1) = s
    end subroutine claim
  end subroutine keep_apart

  !> Ranks that divide a box: early blocks belong to the rank and compute no bond to a copy, the
  !> late ones are the others, and where forces must not depend on the ranks some more. Slabs of one
  !> colour are apart, early or late.
  subroutine test_late(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type), target :: scene
    type(survey_type), target :: survey
    type(work_of_windows) :: work
    type(work_rule_type) :: costs
    type(division_type) :: division
    type(body_type) :: body
    type(lattice_family_type) :: family
    type(fault_type), allocatable :: fault
    type(volume_rule_type) :: rule
    integer, allocatable :: owner(:)
    integer :: early, late, shape, r, colour, fixed
    integer, parameter :: ranks = 3

    early = 0
    late = 0
    do shape = 1, size(shapes, 2)
      call box_scene(shapes(:, shape), spacing, 0.3_wp, scene)
      call survey_points(scene, survey, fault)
      if (allocated(fault)) call test_failed(error, fault%message)
      if (allocated(error)) return
      call rule_of_work(scene, survey%none%delta, spacing, survey%lower, survey%upper, costs)
      rule%delta = survey%none%delta
      rule%kind = volume_rule_number('linear')
      do fixed = 0, 1
        call begin_work(scene, survey, costs, merge(lanes, 1, fixed == 1), work)
        call divide_space(work, ranks, division)
        do r = 0, ranks - 1
          call make_part(scene, survey, division, r, reach(rule, spacing, 3), body, owner)
          if (fixed == 1) body%grids(1)%lowest = survey%lowest(:, 1)
          call new_lattice_family(body, rule, .false., .false., family, fault)
          if (allocated(fault)) call test_failed(error, fault%message)
          if (allocated(error)) return
          do colour = 1, 4
            call keep_apart(family, colour, error)
          end do
          call judge(body, family, fixed == 1, early, late, error)
          if (allocated(error)) return
        end do
      end do
    end do
    call expect_true(error, early > 100 .and. late > 100, 'all blocks come early, or late')
  end subroutine test_late

  !> Count the early and the late blocks of a rank, and see that they are what they should be.
  subroutine judge(body, family, fixed, early, late, error)
    type(body_type), intent(in) :: body
    type(lattice_family_type), intent(in) :: family
    logical, intent(in) :: fixed
    integer, intent(inout) :: early, late
    type(error_type), allocatable, intent(inout) :: error
    type(bonds_type) :: bonds
    logical :: needs
    integer :: b, k, last

    call allocate_bonds(family, bonds)
    associate (slabs => family%slabs)
      last = slabs%first(slabs%colour(3)) - 1
      call expect_true(error, slabs%first(slabs%colour(5)) - 1 == size(family%block), 'all blocks')
      do b = 1, size(family%block)
        needs = .false.
        do k = int(family%block(b)), int(family%block(b)) + lanes - 1
          if (body%point(k) == 0) cycle
          call family%bonds_of(k, bonds)
          needs = needs .or. .not. owned(body, k) .or. any(bonds%j(:bonds%n) > k .and. .not. &
            & owned(body, int(bonds%j(:bonds%n))))
        end do
        if (b <= last) then
          early = early + 1
          call expect_true(error, .not. needs, 'an early block needs a copy')
        else
          late = late + 1
          ! dead lanes count as others do
          if (.not. fixed) call expect_true(error, needs .or. any(body%point(family%block(b): &
            & family%block(b) + lanes - 1) == 0) .or. near_dead(b), 'a late block needs no copy')
        end if
      end do
    end associate

  contains

    !> Whether a forward offset of some lane leads to a dead slot.
    logical function near_dead(b)
      integer, intent(in) :: b
      integer :: o
      near_dead = .false.
      associate (grid => family%grids(1), first => family%block(b))
        do o = 1, grid%n
          if (grid%shift(o) > 0) near_dead = near_dead .or. any(body%point(first + grid%shift(o): &
            & first + grid%shift(o) + lanes - 1) == 0)
        end do
      end associate
    end function near_dead
  end subroutine judge

  !> Slabs hold all blocks in ascending order within each slab, and every live slot has its block.
  subroutine test_whole(error)
    type(error_type), allocatable, intent(out) :: error
    type(set_up_type) :: set_up
    integer, allocatable :: covered(:)
    integer :: shape, s, b

    do shape = 1, size(shapes, 2)
      call box(shapes(:, shape), .false., shape == 1, set_up, error)
      if (allocated(error)) return
      select type (family => set_up%system%family)
      type is (lattice_family_type)
        associate (slabs => family%slabs)
          covered = [(0, s=1, family%n_slots)]
          call expect_true(error, slabs%colour(5) == size(slabs%first), 'slabs without colour')
          call expect_true(error, slabs%first(1) == 1 .and. slabs%first(size(slabs%first)) &
            & == size(family%block) + 1, 'blocks outside all slabs')
          do s = 1, size(slabs%first) - 1
            do b = slabs%first(s), slabs%first(s + 1) - 1
              covered(family%block(b):family%block(b) + lanes - 1) = &
                & covered(family%block(b):family%block(b) + lanes - 1) + 1
              if (b > slabs%first(s)) call expect_true(error, &
                & family%block(b) > family%block(b - 1), 'blocks out of order')
            end do
          end do
        end associate
        call expect_true(error, all(covered == 1 .or. (family%alive == 0_i1 .and. covered == 0)), &
          & 'a live slot in no block, or in two')
      end select
    end do
  end subroutine test_whole

  !> Strains from nothing to well beyond the fast formula, so that both kinds of loops add.
  subroutine test_threads(error)
    type(error_type), allocatable, intent(out) :: error
    type(set_up_type) :: set_up
    real(wp), allocatable :: force(:, :), p(:)
    integer(i1), allocatable :: strained(:)
    integer :: shape, threads, before

    before = omp_get_max_threads()
    do shape = 1, size(shapes, 2)
      call box(shapes(:, shape), .true., shape == 1, set_up, error)
      if (allocated(error)) exit
      associate (system => set_up%system)
        call shake(system%body, some_gradient(0.02_wp), 0.03_wp*spacing, 7, system%state%u)
        do threads = 1, 4
          call omp_set_num_threads(threads)
          call both_passes(system)
          if (threads == 1) then
            force = system%state%force
            p = system%state%p
            strained = system%strained
            call expect_true(error, any(strained == 1_i1) .and. any(strained == 0_i1), &
              & 'no slot, or every one, is strained')
          end if
          ! differences of equal bits are exactly zero
          call expect_close(error, system%state%force, force, 0.0_wp, 'force')
          call expect_close(error, system%state%p, p, 0.0_wp, 'dilatation')
          call expect_true(error, all(system%strained == strained), 'marks')
        end do
      end associate
    end do
    call omp_set_num_threads(before)
  end subroutine test_threads

  !> Every bond just below or just above the strain up to which the fast formula serves, |e| = 0.02:
  !> a bond that both loops took, or none, would change the force by the size of a bond's own force.
  !> The tolerance is that of `test_force_contract`.
  subroutine test_once(error)
    type(error_type), allocatable, intent(out) :: error
    type(set_up_type) :: set_up
    real(wp), allocatable :: f_ref(:, :)
    real(wp) :: gradient(3, 3), stretch
    integer, parameter :: small(3) = [12, 10, 11]
    integer :: i, dim

    do dim = 2, 3
      call box(small(:dim), .false., .false., set_up, error)
      if (allocated(error)) return
      associate (system => set_up%system)
        do i = -3, 3
          ! |e| is within a few units in the last place of the limit for all bonds at once
          stretch = sqrt(1.02_wp*(1 + i*epsilon(stretch))) - 1
          gradient = 0.0_wp
          gradient(1, 1) = stretch
          gradient(2, 2) = stretch
          gradient(3, 3) = stretch
          call shake(system%body, gradient, 0.0_wp, 7, system%state%u)
          call both_passes(system)
          allocate (f_ref, mold=system%state%force)
          call reference_force(system%family, system%model, system%state%u, f_ref)
          call expect_close(error, system%state%force, f_ref, &
            & 1.0e-12_wp*max_abs(f_ref), 'force')
          deallocate (f_ref)
        end do
      end associate
    end do
  end subroutine test_once

  subroutine both_passes(system)
    type(system_type), intent(inout) :: system
    associate (state => system%state)
      call internal_force(system%body, system%family, system%model, options_of(system%model), &
        & system%workspace, state%u, state%p, state%force, system%strained)
    end associate
  end subroutine both_passes

end module test_family_slabs
