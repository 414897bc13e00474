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
    real(wp), allocatable :: xi(:, :)         !! undeformed bond and V_j (4, bond)
    real(wp), allocatable :: eta(:, :)        !! relative displacement and p_k + p_j (4, bond)
  end type stage_type

contains

  !> p_k = 2 a d delta theta_k of all slots. If bonds can break, `strained` gets 1 for slots with an
  !> intact bond beyond its limit.
  subroutine list_dilatation(family, model, u, p, strained)
    type(list_family_type), intent(inout) :: family
    type(model_type), intent(in) :: model
    real(wp), intent(in), contiguous :: u(:, :)
    real(wp), intent(inout), contiguous :: p(:)
    integer(i1), intent(inout), contiguous :: strained(:)
    type(stage_type) :: stage
    integer :: k, n
    integer(i8) :: first

    call gather_state(family, u)
    !$omp parallel default(none) shared(family, model, p, strained) private(stage, k, n, first)
    call allocate_stage(stage, family%most_bonds, model%dim)
    !$omp do schedule(dynamic, 256)
    do k = 1, family%n_slots
      first = family%start(k)
      n = int(family%start(k + 1) - first)
      call deform(family, model, k, n, first, stage, strained)
      call factors(model, n, family%neighbour(first:first + n - 1), k, &
        & stage%across, model%D, stage%factor)
      p(k) = model%materials(model%material(k))%p*model%materials(model%material(k))%t* &
        & sum(stage%factor(:n)*stage%stretch(:n)*stage%lambda(:n)*stage%weight(:n))
    end do
    !$omp end parallel
  end subroutine list_dilatation

  !> Force density of all slots (n_slots, dim) [N/m3] from displacements and the coefficients p.
  subroutine list_force(family, model, u, p, force, strained)
    type(list_family_type), intent(inout) :: family
    type(model_type), intent(in) :: model
    real(wp), intent(in), contiguous :: u(:, :)
    real(wp), intent(in), contiguous :: p(:)
    real(wp), intent(inout), contiguous :: force(:, :)
    integer(i1), intent(inout), contiguous :: strained(:)
    type(stage_type) :: stage
    integer :: k, n, c, i
    integer(i8) :: first
    real(wp) :: q

    call gather_state(family, u, p)
    !$omp parallel default(none) shared(family, model, force, strained) &
    !$omp private(stage, k, n, c, i, first, q)
    call allocate_stage(stage, family%most_bonds, model%dim)
    !$omp do schedule(dynamic, 256)
    do k = 1, family%n_slots
      first = family%start(k)
      n = int(family%start(k + 1) - first)
      call deform(family, model, k, n, first, stage, strained)
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
            stage%stretch(i) = stage%stretch(i) &
              & + stage%eta(4, i)*stage%factor(i)*stage%lambda(i)/stage%length(i)
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
    type(list_family_type), intent(inout) :: family
    type(model_type), intent(in) :: model
    real(wp), intent(in), contiguous :: u(:, :)
    real(wp), intent(inout), contiguous :: energy(:)
    integer(i1), intent(inout), contiguous :: strained(:)
    type(stage_type) :: stage
    integer :: k, n
    integer(i8) :: first

    call gather_state(family, u)
    !$omp parallel default(none) shared(family, model, energy, strained) private(stage, k, n, first)
    call allocate_stage(stage, family%most_bonds, model%dim)
    !$omp do schedule(dynamic, 256)
    do k = 1, family%n_slots
      first = family%start(k)
      n = int(family%start(k + 1) - first)
      call deform(family, model, k, n, first, stage, strained)
      associate (m => model%materials(model%material(k)), &
        & neighbour => family%neighbour(first:first + n - 1))
        call factors(model, n, neighbour, k, stage%across, model%S, stage%factor)
        energy(k) = m%q/2*sum(stage%factor(:n)*stage%stretch(:n)**2*stage%length(:n) &
          & *stage%weight(:n))
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
      & stage%lambda(n), stage%weight(n), stage%factor(n), stage%xi(4, n), stage%eta(4, n))
  end subroutine allocate_stage

  !> Copy displacements, and p if there is one, point by point: what a bond needs of its other end
  !> then stands in one place, while gathering each component by itself is what the loops would wait
  !> for.
  subroutine gather_state(family, u, p)
    type(list_family_type), intent(inout) :: family
    real(wp), intent(in), contiguous :: u(:, :)
    real(wp), intent(in), contiguous, optional :: p(:)
    integer :: k, c

    !$omp parallel do schedule(static) default(none) shared(family, u, p) private(k, c)
    do k = 1, family%n_slots
      do c = 1, size(u, 2)
        family%moved(c, k) = u(k, c)
      end do
      if (.not. present(p)) cycle
      if (size(p) > 0) family%moved(4, k) = p(k)
    end do
  end subroutine gather_state

  !> Bond vectors, relative displacements and p_k + p_j of the bonds of slot `k`. Negating and
  !> adding is what makes both ends of a bond see the same bits.
  pure subroutine fetch(n, n_slots, neighbour, place, moved, k, xi, eta)
    integer, intent(in) :: n, n_slots, k
    integer(i4), intent(in) :: neighbour(n)
    real(wp), intent(in) :: place(4, n_slots), moved(4, n_slots)
    real(wp), intent(inout) :: xi(4, n), eta(4, n)
    real(wp) :: own(4), own_moved(4)
    integer :: i, j, c

    own = [-place(1, k), -place(2, k), -place(3, k), 0.0_wp]
    own_moved = [-moved(1, k), -moved(2, k), -moved(3, k), moved(4, k)]
    ! four components at a time, not the bonds: vectors of bonds would be gathered number by number
    do i = 1, n
      j = neighbour(i)
      !$omp simd
      do c = 1, 4
        xi(c, i) = place(c, j) + own(c)
        eta(c, i) = moved(c, j) + own_moved(c)
      end do
    end do
  end subroutine fetch

  !> Geometry of the bonds of slot `k`: stretch, direction, Lambda and weight.
  subroutine deform(family, model, k, n, first, stage, strained)
    type(list_family_type), intent(in) :: family
    type(model_type), intent(in) :: model
    integer, intent(in) :: k, n
    integer(i8), intent(in) :: first
    type(stage_type), intent(inout) :: stage
    integer(i1), intent(inout), contiguous :: strained(:)
    real(wp) :: limit
    integer :: i

    associate (neighbour => family%neighbour(first:first + n - 1), &
      & intact => family%intact(first:first + n - 1), most => family%most_bonds)
      call fetch(n, family%n_slots, neighbour, family%place, family%moved, k, stage%xi, stage%eta)
      ! constant dimensions, so that each has a loop of its own
      select case (model%dim)
      case (3)
        call geometry_3(n, most, stage%xi, stage%eta, model%surface, stage%normal, stage%across, &
          & stage%length, stage%stretch, stage%lambda)
      case (2)
        call geometry_2(n, most, stage%xi, stage%eta, model%surface, stage%normal, stage%across, &
          & stage%length, stage%stretch, stage%lambda)
      case default
        call geometry_1(n, most, stage%xi, stage%eta, model%surface, stage%normal, stage%across, &
          & stage%length, stage%stretch, stage%lambda)
      end select
      call weights(family, k, n, neighbour, intact, stage%length, stage%xi, stage%weight)
      if (.not. model%projected) stage%lambda(:n) = 1.0_wp
      if (model%thermal) then
        do i = 1, n
          stage%stretch(i) = stage%stretch(i) &
            & - (model%expansion(k) + model%expansion(neighbour(i)))/2
        end do
      end if
      if (.not. model%breaking) return
      ! marked a hair's breadth early, and by the smallest limit of all: what breaks is decided
      ! elsewhere
      strained(k) = 0_i1
      if (model%critical(k) < 0.0_wp) return
      limit = model%least_critical*(1 - 1.0e-9_wp)
      if (any(stage%stretch(:n) > limit .and. intact == 1_i1)) strained(k) = 1_i1
      if (.not. model%compression) return
      if (model%compressed(k) == 1_i1 .and. any(-stage%stretch(:n) > limit .and. intact == 1_i1)) &
        & strained(k) = 1_i1
    end associate
  end subroutine deform

  ! One text for all dimensions, code of its own for each: the dimension must be a constant where
  ! the loops are compiled.

  pure subroutine geometry_1(n, most, r, d, surface, normal, across, length, stretch, lambda)
    integer, parameter :: dim = 1
    include 'bond_geometry.inc'
  end subroutine geometry_1

  pure subroutine geometry_2(n, most, r, d, surface, normal, across, length, stretch, lambda)
    integer, parameter :: dim = 2
    include 'bond_geometry.inc'
  end subroutine geometry_2

  pure subroutine geometry_3(n, most, r, d, surface, normal, across, length, stretch, lambda)
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
  pure subroutine weights(family, k, n, neighbour, intact, length, xi, weight)
    type(list_family_type), intent(in) :: family
    integer, intent(in) :: k, n
    integer(i4), intent(in) :: neighbour(n)
    integer(i1), intent(in) :: intact(n)
    real(wp), intent(in) :: length(n), xi(4, n)
    real(wp), intent(inout) :: weight(n)
    real(wp) :: spacing, edge, per_spacing
    integer :: i

    do i = 1, n
      weight(i) = real(intact(i), wp)*xi(4, i)
    end do
    select case (family%rule%kind)
    case (volume_none)
      continue
    case (volume_exact)
      weight = weight*family%fraction(family%start(k):family%start(k) + n - 1)
    case default
      if (family%one_spacing) then
        edge = family%rule%delta + family%spacing(k)/2
        per_spacing = 1/family%spacing(k)
        do i = 1, n
          weight(i) = weight(i)*max(0.0_wp, min(1.0_wp, (edge - length(i))*per_spacing))
        end do
      else
        do i = 1, n
          spacing = (family%spacing(k) + family%spacing(neighbour(i)))/2
          weight(i) = weight(i) &
            & *max(0.0_wp, min(1.0_wp, (family%rule%delta + spacing/2 - length(i))/spacing))
        end do
      end if
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
