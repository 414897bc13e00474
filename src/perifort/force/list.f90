!> The force loops of list families. The bonds of one point are worked through in stages on short
!> arrays that stay in the first-level cache: each stage is one loop that vectorises, and a term the
!> scene doesn't have is a stage that doesn't run.
module pd_force_list
  use pd_base_kinds, only: wp, i1, i4, i8
  use pd_family_list, only: list_family_type
  use pd_family_volume, only: volume_none, volume_exact
  use pd_force_model, only: model_type
  implicit none (type, external)
  private
  public :: list_dilatation, list_force, list_energy

  !> Quantities of the bonds of one point.
  type :: stage_type
    real(wp), allocatable :: normal(:, :)     !! direction of the deformed bond (bond, dim)
    real(wp), allocatable :: across(:, :)     !! squares of the undeformed direction (bond, dim)
    real(wp), allocatable :: length(:)        !! |xi|
    real(wp), allocatable :: stretch(:)       !! mechanical stretch
    real(wp), allocatable :: lambda(:)        !! Lambda
    real(wp), allocatable :: weight(:)        !! v_c V_j, 0 if broken
    real(wp), allocatable :: factor(:)        !! Gd or Gb
  end type stage_type

contains

  !> p_k = 2 a d delta theta_k of all slots. If bonds can break, `strained` gets 1 for slots with an
  !> intact bond beyond its limit.
  subroutine list_dilatation(family, model, u, p, strained)
    type(list_family_type), intent(in) :: family
    type(model_type), intent(in) :: model
    real(wp), intent(in), contiguous :: u(:, :)
    real(wp), intent(inout), contiguous :: p(:)
    integer(i1), intent(inout), contiguous :: strained(:)
    type(stage_type) :: stage
    integer :: k, n
    integer(i8) :: first

    !$omp parallel default(none) shared(family, model, u, p, strained) private(stage, k, n, first)
    call allocate_stage(stage, family%most_bonds, model%dim)
    !$omp do schedule(dynamic, 256)
    do k = 1, family%n_slots
      first = family%start(k)
      n = int(family%start(k + 1) - first)
      call deform(family, model, u, k, n, first, stage, strained)
      call factors(model, n, family%neighbour(first:first + n - 1), k, &
        & stage%across, model%D, stage%factor)
      p(k) = model%materials(model%material(k))%p*model%materials(model%material(k))%t* &
        & sum(stage%factor(:n)*stage%stretch(:n)*stage%lambda(:n)*stage%weight(:n))
    end do
    !$omp end parallel
  end subroutine list_dilatation

  !> Force density of all slots (n_slots, dim) [N/m3] from displacements and the coefficients p.
  subroutine list_force(family, model, u, p, force, strained)
    type(list_family_type), intent(in) :: family
    type(model_type), intent(in) :: model
    real(wp), intent(in), contiguous :: u(:, :)
    real(wp), intent(in), contiguous :: p(:)
    real(wp), intent(inout), contiguous :: force(:, :)
    integer(i1), intent(inout), contiguous :: strained(:)
    type(stage_type) :: stage
    integer :: k, n, c, i, j
    integer(i8) :: first
    real(wp) :: q

    !$omp parallel default(none) shared(family, model, u, p, force, strained) &
    !$omp private(stage, k, n, c, i, j, first, q)
    call allocate_stage(stage, family%most_bonds, model%dim)
    !$omp do schedule(dynamic, 256)
    do k = 1, family%n_slots
      first = family%start(k)
      n = int(family%start(k + 1) - first)
      call deform(family, model, u, k, n, first, stage, strained)
      associate (neighbour => family%neighbour(first:first + n - 1))
        call factors(model, n, neighbour, k, stage%across, model%S, stage%factor)
        if (size(model%materials) == 1) then
          q = 2*model%materials(1)%q
          stage%stretch(:n) = q*stage%factor(:n)*stage%stretch(:n)
        else
          q = model%materials(model%material(k))%q
          do i = 1, n
            stage%stretch(i) = (q + model%materials(model%material(neighbour(i)))%q) &
              & *stage%factor(i)*stage%stretch(i)
          end do
        end if
        if (model%dilatation) then
          call factors(model, n, neighbour, k, stage%across, model%D, stage%factor)
          do i = 1, n
            j = neighbour(i)
            stage%stretch(i) = stage%stretch(i) &
              & + (p(k) + p(j))*stage%factor(i)*stage%lambda(i)/stage%length(i)
          end do
        end if
      end associate
      do c = 1, model%dim
        force(k, c) = sum(stage%stretch(:n)*stage%weight(:n)*stage%normal(:n, c))
      end do
    end do
    !$omp end parallel
  end subroutine list_force

  !> Strain energy density of all slots [J/m3].
  subroutine list_energy(family, model, u, energy, strained)
    type(list_family_type), intent(in) :: family
    type(model_type), intent(in) :: model
    real(wp), intent(in), contiguous :: u(:, :)
    real(wp), intent(inout), contiguous :: energy(:)
    integer(i1), intent(inout), contiguous :: strained(:)
    type(stage_type) :: stage
    integer :: k, n
    integer(i8) :: first

    !$omp parallel default(none) shared(family, model, u, energy, strained) private(stage, k, n, first)
    call allocate_stage(stage, family%most_bonds, model%dim)
    !$omp do schedule(dynamic, 256)
    do k = 1, family%n_slots
      first = family%start(k)
      n = int(family%start(k + 1) - first)
      call deform(family, model, u, k, n, first, stage, strained)
      associate (m => model%materials(model%material(k)), &
        & neighbour => family%neighbour(first:first + n - 1))
        call factors(model, n, neighbour, k, stage%across, model%S, stage%factor)
        energy(k) = m%q/2*sum(stage%factor(:n)*stage%stretch(:n)**2*stage%length(:n)*stage%weight(:n))
        if (abs(m%a) > 0.0_wp) then
          call factors(model, n, neighbour, k, stage%across, model%D, stage%factor)
          energy(k) = energy(k) + m%a*(m%t*sum(stage%factor(:n)*stage%stretch(:n)*stage%lambda(:n) &
            & *stage%weight(:n)))**2
        end if
      end associate
    end do
    !$omp end parallel
  end subroutine list_energy

  pure subroutine allocate_stage(stage, n, dim)
    type(stage_type), intent(out) :: stage
    integer, intent(in) :: n, dim
    allocate (stage%normal(n, dim), stage%across(n, dim), stage%length(n), stage%stretch(n), &
      & stage%lambda(n), stage%weight(n), stage%factor(n))
  end subroutine allocate_stage

  !> Geometry of the bonds of slot `k`: stretch, direction, Lambda and weight.
  subroutine deform(family, model, u, k, n, first, stage, strained)
    type(list_family_type), intent(in) :: family
    type(model_type), intent(in) :: model
    real(wp), intent(in), contiguous :: u(:, :)
    integer, intent(in) :: k, n
    integer(i8), intent(in) :: first
    type(stage_type), intent(inout) :: stage
    integer(i1), intent(inout), contiguous :: strained(:)
    integer :: i, j
    logical :: over

    associate (neighbour => family%neighbour(first:first + n - 1), &
      & intact => family%intact(first:first + n - 1), most => family%most_bonds)
      ! constant dimensions, so that each has a loop of its own
      select case (model%dim)
      case (3)
        call geometry_3(n, most, family%n_slots, neighbour, family%x, u, k, model%surface, &
          & stage%normal, stage%across, stage%length, stage%stretch, stage%lambda)
      case (2)
        call geometry_2(n, most, family%n_slots, neighbour, family%x, u, k, model%surface, &
          & stage%normal, stage%across, stage%length, stage%stretch, stage%lambda)
      case default
        call geometry_1(n, most, family%n_slots, neighbour, family%x, u, k, model%surface, &
          & stage%normal, stage%across, stage%length, stage%stretch, stage%lambda)
      end select
      call weights(family, k, n, neighbour, intact, stage%length, stage%weight)
      if (.not. model%projected) stage%lambda(:n) = 1.0_wp
      if (model%thermal) then
        do i = 1, n
          stage%stretch(i) = stage%stretch(i) - (model%expansion(k) + model%expansion(neighbour(i)))/2
        end do
      end if
      if (.not. model%breaking) return
      over = .false.
      do i = 1, n
        j = neighbour(i)
        over = over .or. exceeds(stage%stretch(i), min(model%critical(k), model%critical(j)), intact(i))
      end do
      if (model%compression) then
        do i = 1, n
          over = over .or. exceeds(-stage%stretch(i), &
            & min(model%critical(k), model%critical(neighbour(i))), intact(i))
        end do
      end if
      strained(k) = merge(1_i1, 0_i1, over)
    end associate
  end subroutine deform

  !> Whether an intact bond is beyond its limit (negative: no-fail), by a hair's breadth at most less:
  !> the decision itself is made once for both ends, elsewhere.
  elemental logical function exceeds(stretch, limit, intact)
    real(wp), intent(in) :: stretch, limit
    integer(i1), intent(in) :: intact
    exceeds = stretch > limit*(1 - 1.0e-9_wp) .and. limit >= 0.0_wp .and. intact == 1_i1
  end function exceeds

  ! One text for all dimensions, code of its own for each: the dimension must be a constant where
  ! the loops are compiled.

  pure subroutine geometry_1(n, most, n_slots, neighbour, x, u, k, surface, normal, across, &
    & length, stretch, lambda)
    integer, parameter :: dim = 1
    include 'bond_geometry.inc'
  end subroutine geometry_1

  pure subroutine geometry_2(n, most, n_slots, neighbour, x, u, k, surface, normal, across, &
    & length, stretch, lambda)
    integer, parameter :: dim = 2
    include 'bond_geometry.inc'
  end subroutine geometry_2

  pure subroutine geometry_3(n, most, n_slots, neighbour, x, u, k, surface, normal, across, &
    & length, stretch, lambda)
    integer, parameter :: dim = 3
    include 'bond_geometry.inc'
  end subroutine geometry_3

  pure subroutine factors_1(n, most, n_slots, neighbour, k, across, g, factor)
    integer, parameter :: dim = 1
    include 'bond_factors.inc'
  end subroutine factors_1

  pure subroutine factors_2(n, most, n_slots, neighbour, k, across, g, factor)
    integer, parameter :: dim = 2
    include 'bond_factors.inc'
  end subroutine factors_2

  pure subroutine factors_3(n, most, n_slots, neighbour, k, across, g, factor)
    integer, parameter :: dim = 3
    include 'bond_factors.inc'
  end subroutine factors_3

  !> v_c V_j of n bonds, 0 for broken ones.
  pure subroutine weights(family, k, n, neighbour, intact, length, weight)
    type(list_family_type), intent(in) :: family
    integer, intent(in) :: k, n
    integer(i4), intent(in) :: neighbour(n)
    integer(i1), intent(in) :: intact(n)
    real(wp), intent(in) :: length(n)
    real(wp), intent(inout) :: weight(n)
    real(wp) :: spacing
    integer :: i, j

    select case (family%rule%kind)
    case (volume_none)
      do i = 1, n
        weight(i) = real(intact(i), wp)*family%volume(neighbour(i))
      end do
    case (volume_exact)
      do i = 1, n
        weight(i) = real(intact(i), wp)*family%volume(neighbour(i))*family%fraction(family%start(k) + i - 1)
      end do
    case default
      do i = 1, n
        j = neighbour(i)
        spacing = (family%spacing(k) + family%spacing(j))/2
        weight(i) = real(intact(i), wp)*family%volume(j) &
          & *max(0.0_wp, min(1.0_wp, (family%rule%delta + spacing/2 - length(i))/spacing))
      end do
    end select
  end subroutine weights

  !> Surface factors G of n bonds from those of their ends (7.7); 1 without surface correction.
  pure subroutine factors(model, n, neighbour, k, across, g, factor)
    type(model_type), intent(in) :: model
    integer, intent(in) :: n
    integer(i4), intent(in) :: neighbour(n)
    integer, intent(in) :: k
    real(wp), intent(in), contiguous :: across(:, :)
    real(wp), allocatable, intent(in) :: g(:, :)
    real(wp), intent(inout), contiguous :: factor(:)

    if (.not. model%surface) then
      factor(:n) = 1.0_wp
      return
    end if
    select case (model%dim)
    case (3)
      call factors_3(n, size(across, 1), size(g, 1), neighbour, k, across, g, factor)
    case (2)
      call factors_2(n, size(across, 1), size(g, 1), neighbour, k, across, g, factor)
    case default
      call factors_1(n, size(across, 1), size(g, 1), neighbour, k, across, g, factor)
    end select
  end subroutine factors

end module pd_force_list
