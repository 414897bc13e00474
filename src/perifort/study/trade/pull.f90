!> Whether a scene is a uniaxial pull, and its data, for the closed forms of tension and of a hole.
module pd_study_trade_pull
  use pd_base_kinds, only: wp
  use pd_scene_content_groups, only: sides
  use pd_scene_content_types, only: is_set, load_group, scene_type
  use pd_study_trade_closed_form, only: closed_form_type
  implicit none (type, external)
  private
  public :: pull

  real(wp), parameter :: tolerance = 1.0e-9_wp      !! of equality [-]

  !> What acts along one direction: at each end (1 lower, 2 upper) a traction, or a displacement.
  type :: ends_type
    logical :: loaded(2) = .false., held(2) = .false.
    real(wp) :: traction(2) = 0.0_wp           !! outwards [Pa]
    real(wp) :: displacement(2) = 0.0_wp       !! [m]
  end type ends_type

contains

  !> Direction and strain of a uniaxial pull, and where the displacements are 0: `origin` and
  !> `shift`. Each of two opposite sides is loaded along its normal, or moved along it; a smooth
  !> wall at one other side of a direction says where that side stays.
  subroutine pull(scene, form, axis, strain, reason)
    type(scene_type), intent(in) :: scene          !! of one lattice body
    type(closed_form_type), intent(inout) :: form  !! with dim and modulus; origin and shift are set
    integer, intent(out) :: axis  !! direction of the pull, 1 to 3; 0 if there is none
    real(wp), intent(out) :: strain                !! along the axis [-]
    character(:), allocatable, intent(inout) :: reason  !! '' before; on return why it is no
                                                        !! uniaxial pull, '' if it is
    type(ends_type) :: ends(3)
    integer :: c, e

    axis = 0
    strain = 0.0_wp
    if (scene%time%method /= 'relaxation') reason = "it needs &time method = 'relaxation'"
    call collect_ends(scene, ends, reason)
    if (len(reason) > 0) return
    do c = 1, form%dim
      if (.not. any(ends(c)%loaded) .and. count(ends(c)%held) < 2) cycle
      if (axis > 0) reason = 'the body is pulled along more than one direction'
      axis = c
    end do
    if (axis == 0) reason = 'no pair of opposite sides is pulled'
    if (len(reason) > 0) return
    associate (low => scene%bodies(1)%lower, high => scene%bodies(1)%upper, end => ends(axis))
      form%origin(:form%dim) = (low(:form%dim) + high(:form%dim))/2
      if (all(end%held)) then
        strain = (end%displacement(2) - end%displacement(1))/(high(axis) - low(axis))
        form%shift(axis) = sum(end%displacement)/2
      else if (all(end%loaded)) then
        strain = end%traction(1)/form%modulus
        if (abs(end%traction(1) - end%traction(2)) > tolerance*abs(end%traction(1))) &
          & reason = 'the two ends are pulled differently'
      else if (any(end%held)) then
        e = merge(1, 2, end%held(1))
        strain = end%traction(3 - e)/form%modulus
        form%origin(axis) = merge(low(axis), high(axis), e == 1)
        form%shift(axis) = end%displacement(e)
      else
        reason = 'one end is pulled and the other is neither pulled nor held'
      end if
      do c = 1, form%dim
        if (c == axis .or. .not. any(ends(c)%held)) cycle
        e = merge(1, 2, ends(c)%held(1))
        form%origin(c) = merge(low(c), high(c), e == 1)
        form%shift(c) = ends(c)%displacement(e)
      end do
    end associate
    if (len(reason) == 0 .and. abs(strain) <= 0.0_wp) reason = 'nothing is pulled'
  end subroutine pull

  !> The action on each side; actions other than a pull along a side's normal are refused.
  subroutine collect_ends(scene, ends, reason)
    type(scene_type), intent(in) :: scene
    type(ends_type), intent(out) :: ends(3)
    character(:), allocatable, intent(inout) :: reason
    integer :: i, c, e, side

    do i = 1, size(scene%loads)
      associate (load => scene%loads(i))
        side = side_number(load%side)
        if (side == 0) then
          reason = 'a &load acts on a region'
          return
        end if
        c = (side + 1)/2
        e = 2 - modulo(side, 2)
        ends(c)%loaded(e) = .true.
        ends(c)%traction(e) = ends(c)%traction(e) + traction_of(scene, load, c, e, reason)
      end associate
    end do
    do i = 1, size(scene%boundaries)
      associate (boundary => scene%boundaries(i))
        side = side_number(boundary%side)
        if (side == 0) then
          reason = 'a &boundary moves a region'
          return
        end if
        c = (side + 1)/2
        e = 2 - modulo(side, 2)
        ends(c)%held(e) = is_set(boundary%displacement(c))
        if (any(is_set(boundary%velocity))) reason = 'a &boundary imposes a velocity'
        if (count(is_set(boundary%displacement)) /= merge(1, 0, ends(c)%held(e))) &
          & reason = 'a &boundary holds more than the direction of its side, '// &
          & 'which hinders the contraction across'
        if (ends(c)%held(e)) ends(c)%displacement(e) = boundary%displacement(c)
      end associate
    end do
  end subroutine collect_ends

  !> Traction outwards along direction `c` at end `e` [Pa].
  real(wp) function traction_of(scene, load, c, e, reason) result(traction)
    type(scene_type), intent(in) :: scene
    type(load_group), intent(in) :: load
    integer, intent(in) :: c, e
    character(:), allocatable, intent(inout) :: reason
    real(wp) :: area
    integer :: k, d

    d = scene%header%dimension
    traction = 0.0_wp
    if (is_set(load%pressure)) traction = -load%pressure
    if (any(is_set(load%body_force))) reason = 'a &load is a body force'
    do k = 1, d
      if (.not. is_set(load%force(k))) cycle
      if (k /= c) reason = 'a &load acts across the direction of its side'
      area = 1.0_wp
      if (d == 2) area = scene%header%thickness
      if (d == 1) area = scene%header%area
      area = area*product(scene%bodies(1)%upper(:d) - scene%bodies(1)%lower(:d)) &
        & /(scene%bodies(1)%upper(c) - scene%bodies(1)%lower(c))
      traction = traction + merge(-1.0_wp, 1.0_wp, e == 1)*load%force(k)/area
    end do
  end function traction_of

  !> 1 to 6 for x_min to z_max, 0 for none.
  pure integer function side_number(side)
    character(*), intent(in) :: side
    do side_number = size(sides), 1, -1
      if (sides(side_number) == side) return
    end do
  end function side_number

end module pd_study_trade_pull
