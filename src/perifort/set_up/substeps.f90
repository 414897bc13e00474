!> `&time substeps`: which scenes can have them, and the levels of their grids.
module pd_set_up_substeps
  use pd_base_error, only: error_type
  use pd_base_kinds, only: wp
  use pd_base_text, only: to_text
  use pd_family_composite, only: composite_family_type
  use pd_family_family, only: allocate_bonds, bonds_type
  use pd_force_model, only: no_fail
  use pd_motion_conditions, only: moves
  use pd_motion_loads, only: other_terms
  use pd_motion_system, only: system_type
  use pd_scene_content_rules, only: scene_fault
  use pd_scene_content_types, only: is_set, scene_type
  implicit none (type, external)
  private
  public :: arrange_substeps, check_step, bound_by_levels

  real(wp), parameter :: largest_part = 0.8_wp  !! of the stable step, beyond which impulses of
                                                !! coarser levels may resonate (doc/theory.md, 5)
  real(wp), parameter :: same = 1.0e-6_wp       !! a power of two, relative
  integer, parameter :: most_levels = 8

contains

  !> Give the grids of a scene with `substeps` their levels, and its family those of its bonds. An
  !> error is set if the scene has what they do not serve.
  subroutine arrange_substeps(scene, system, error)
    type(scene_type), intent(in) :: scene       !! a checked scene
    type(system_type), intent(inout) :: system
      !! with family, model, conditions and weights; gets levels
    type(error_type), allocatable, intent(out) :: error
    real(wp) :: coarsest, quotient
    integer, allocatable :: level(:)
    integer :: g, i

    if (.not. scene%time%substeps) return
    do i = 1, size(scene%boundaries)
      associate (group => scene%boundaries(i))
        if (group%motion == 'pin') call refuse('boundary', i, 'motion', "motion = 'pin'", &
          & 'its motion is integrated in whole steps')
        if (group%absorbing) call refuse('boundary', i, 'absorbing', 'absorbing boundaries', &
          & 'their dashpots have no level')
      end associate
      if (allocated(error)) return
    end do
    do i = 1, size(scene%loads)
      if (any(is_set(scene%loads(i)%stiffness))) call refuse('load', i, 'stiffness', 'springs', &
        & 'they have no level')
      if (allocated(error)) return
    end do
    if (size(scene%rigids) > 0) then
      call refuse('rigid', 1, '', '&rigid', &
        & 'the motion of rigid bodies is integrated in whole steps')
    else if (size(scene%contacts) > 0) then
      call refuse('contact', 1, '', '&contact', 'its forces have no level')
    else if (other_terms(system%terms) > 0) then
      call refuse('time', 1, 'substeps', 'terms of the force', 'they have no level')
    else if (allocated(system%heating%curves)) then
      call refuse('initial', 1, 'temperature_change', 'a temperature that varies in time', &
        & 'its work is counted in whole steps')
    else if (system%model%generic) then
      call refuse('material', 1, 'model', 'bond laws on the generic pass', &
        & 'it computes all bonds at once')
    end if
    if (allocated(error)) return
    select type (family => system%family)
    type is (composite_family_type)
      associate (grids => family%lattice%grids)
        coarsest = maxval(grids%spacing)
        allocate (level(size(grids)))
        do g = 1, size(grids)
          quotient = log(coarsest/grids(g)%spacing)/log(2.0_wp)
          level(g) = nint(quotient)
          if (abs(quotient - level(g)) > same .or. level(g) > most_levels) then
            call refuse('time', 1, 'substeps', 'lattices with spacings of '// &
              & to_text(coarsest, 4)//' m and '//to_text(grids(g)%spacing, 4)//' m', &
              & 'one must be 2^n times the other, with n up to '//to_text(most_levels))
            return
          end if
        end do
      end associate
      if (maxval(level) == 0) then
        call refuse('time', 1, 'substeps', 'lattices of one spacing', 'all take the same step')
        return
      end if
      if (family%dim == 1 .and. system%model%dilatation) then
        call refuse('time', 1, 'substeps', 'a dilatation in 1D', &
          & 'each end computes its bonds there')
        return
      end if
      call family%give_levels(level, system%workspace%lattice%part)
      system%workspace%lattice%due(2) = int(maxval(level) + 1, kind(system%workspace%lattice%due))
      system%levels = maxval(level)
      allocate (system%beyond(family%n_slots, family%dim), source=0.0_wp)
      i = torn_grip(system, family)
      if (i > 0) then
        call refuse('boundary', i, '', 'moved points whose bonds take substeps and can break', &
          & 'the work of what moves them is counted in whole steps; put them into a &no_fail '// &
          & 'zone, or let cells become finer elsewhere')
        return
      end if
    class default
      call refuse('time', 1, 'substeps', 'a scene without lattices that a list joins', &
        & 'they need &refine or lattices of different spacings that bonds join; the scene has '// &
        & family%describe())
    end select

  contains

    subroutine refuse(group, number, key, what, why)
      character(*), intent(in) :: group, key, what, why
      integer, intent(in) :: number
      call scene_fault(error, scene, group, number, key, '&time substeps do not serve '//what, why)
    end subroutine refuse

  end subroutine arrange_substeps

  !> Number of the first motion that moves a point of which a bond with substeps can break; 0 if
  !> there is none.
  integer function torn_grip(system, family) result(number)
    type(system_type), intent(in) :: system
    type(composite_family_type), intent(in) :: family  !! its family, with levels
    type(bonds_type) :: bonds
    integer :: i, j, k, m

    number = 0
    if (.not. system%model%breaking) return
    call allocate_bonds(family, bonds)
    do m = 1, size(system%motions)
      if (.not. moves(system%motions(m))) cycle
      do i = 1, size(system%motions(m)%slots)
        k = system%motions(m)%slots(i)
        if (system%model%critical(k) <= no_fail) cycle
        call family%bonds_of(k, bonds)
        do j = 1, bonds%n
          if (.not. bonds%intact(j) .or. system%model%critical(bonds%j(j)) <= no_fail) cycle
          if (family%level_of_bond(k, int(bonds%j(j))) == 0) cycle
          number = m
          return
        end do
      end do
    end do
  end function torn_grip

  !> The bound of each point's stiffness for the step of level 0 (doc/theory.md, 5): a point of
  !> level n, whose steps are 2^n times as short, may be 4^n times as stiff.
  subroutine bound_by_levels(system, bound)
    type(system_type), intent(in) :: system   !! with or without levels
    real(wp), intent(inout) :: bound(:)       !! (n_slots) M_k of its own step; of level 0 on return
                                              !! [N/m4]
    integer :: k

    if (system%levels == 0) return
    select type (family => system%family)
    type is (composite_family_type)
      do k = 1, size(bound)
        bound(k) = bound(k)/4.0_wp**family%grid_level(k)
      end do
    class default  ! has no levels
      continue
    end select
  end subroutine bound_by_levels

  !> An error is set if the step of a scene with substeps is so long that they may resonate.
  subroutine check_step(scene, step, limit, error)
    type(scene_type), intent(in) :: scene  !! a checked scene
    real(wp), intent(in) :: step           !! of the run [s]
    real(wp), intent(in) :: limit          !! the stable step [s]
    type(error_type), allocatable, intent(out) :: error

    if (.not. scene%time%substeps .or. step <= largest_part*limit*(1 + same)) return
    call scene_fault(error, scene, 'time', 1, &
      & trim(merge('step  ', 'safety', is_set(scene%time%step))), &
      & 'with substeps the step may be '//to_text(largest_part)//' of the stable one, '// &
      & to_text(limit, 6)//' s; this one is '//to_text(step/limit, 3)//' of it', &
      & 'beyond, the impulses of coarse levels may resonate with the motion of fine ones')
  end subroutine check_step

end module pd_set_up_substeps
