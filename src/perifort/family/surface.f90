!> Surface correction (7.7; doc/theory.md, 4): factors that give points near a surface the stiffness
!> of the bulk.
module pd_family_surface
  use pd_base_kinds, only: wp
  use pd_body_body, only: body_type, share_halo
  use pd_law_laws, only: law_item_type
  use pd_law_material, only: material_type
  use pd_law_weighted, only: weighted_law_type
  use pd_family_family, only: family_type, bonds_type, allocate_bonds
  use pd_family_volume, only: horizon_of_bond
  implicit none (type, external)
  private
  public :: surface_factors, bond_factor

contains

  !> D and S (n_slots, dim) of every slot: classical over peridynamic dilatation and energy under
  !> unit uniaxial strain along each direction, with the linearised stretch. A point without bonds
  !> along a direction gets 1. Families must be whole: cracks are cut afterwards.
  subroutine surface_factors(body, family, materials, D, S, laws, axes)
    type(body_type), intent(in) :: body                     !! arranged in the slots of the family
    class(family_type), intent(in) :: family                !! whole: no bond cut
    type(material_type), intent(in) :: materials(:)  !! (any number) by the numbers that points have
    real(wp), allocatable, intent(out) :: D(:, :), S(:, :)
      !! (n_slots, dim) factors of the dilatation and of the bond part of the energy [-]
    type(law_item_type), intent(in), optional :: laws(:)
      !! (materials) their bond laws; points of laws without correction get 1
    real(wp), intent(in), optional :: axes(:, :)
      !! (dim, dim) directions of the factors in columns, absent: x, y, z
    type(bonds_type) :: bonds
    real(wp) :: strain, dilatation, energy, scale, gb, gd, delta
    integer :: k, i, c
    logical :: weighted, influenced

    influenced = .false.
    if (present(laws)) influenced = has_factors(laws)
    weighted = influenced .or. family%rule%ratio > 0.0_wp
    allocate (D(body%n_slots, body%dim), S(body%n_slots, body%dim), source=1.0_wp)
    !$omp parallel default(none) shared(body, family, materials, D, S, laws, weighted, axes) &
    !$omp shared(influenced) &
    !$omp private(bonds, strain, dilatation, energy, scale, gb, gd, delta, k, i, c)
    call allocate_bonds(family, bonds)
    !$omp do schedule(dynamic, 256)
    do k = 1, body%n_slots
      if (body%point(k) == 0) cycle
      if (family%alike(k) /= k) cycle
      if (present(laws)) then
        if (.not. laws(body%material(k))%law%corrected) cycle
      end if
      call family%bonds_of(k, bonds)
      if (present(axes)) bonds%xi(:bonds%n, :) = matmul(bonds%xi(:bonds%n, :), axes)
      associate (m => materials(body%material(k)))
        do c = 1, body%dim
          dilatation = 0.0_wp
          energy = 0.0_wp
          scale = 0.0_wp
          if (weighted) then
            do i = 1, bonds%n
              strain = (bonds%xi(i, c)/bonds%length(i))**2
              gb = 1.0_wp
              gd = 1.0_wp
              delta = horizon_of_bond(family%rule, body%spacing(k), body%spacing(bonds%j(i)))
              if (present(laws)) then
                if (influenced) call law_factors(laws, int(body%material(k)), &
                  & bonds%length(i)/delta, gb, gd)
              end if
              if (family%rule%ratio > 0.0_wp) then
                gb = gb*(family%rule%delta/delta)**(body%dim + 1)
                gd = gd*(family%rule%delta/delta)**body%dim
              end if
              dilatation = dilatation + gd*strain*bonds%weight(i)
              energy = energy + gb*strain**2*bonds%length(i)*bonds%weight(i)
              scale = scale + bonds%length(i)*bonds%weight(i)
            end do
          else
            do i = 1, bonds%n
              strain = (bonds%xi(i, c)/bonds%length(i))**2
              dilatation = dilatation + strain*bonds%weight(i)
              energy = energy + strain**2*bonds%length(i)*bonds%weight(i)
              scale = scale + bonds%length(i)*bonds%weight(i)
            end do
          end if
          ! a chain inside a plane has no stretch across it, up to the rounding of its positions
          if (energy <= 1.0e-20_wp*scale) cycle
          D(k, c) = 1.0_wp/(m%t*dilatation)
          S(k, c) = (m%uniaxial_energy - m%a)/(m%q/2*energy)
        end do
      end associate
    end do
    !$omp do schedule(static)
    do k = 1, body%n_slots
      i = family%alike(k)
      if (i == k) cycle
      D(k, :) = D(i, :)
      S(k, :) = S(i, :)
    end do
    !$omp end parallel
    call share_halo(body, D)
    call share_halo(body, S)
  end subroutine surface_factors

  !> Whether some law has factors that differ from 1. Without, sums have the bits of the plain loop.
  pure logical function has_factors(laws)
    type(law_item_type), intent(in) :: laws(:)
    integer :: i

    has_factors = .false.
    do i = 1, size(laws)
      select type (law => laws(i)%law)
      class is (weighted_law_type)
        has_factors = has_factors .or. law%has_factors()
      class default  ! its bonds have no factors here
        continue
      end select
    end do
  end function has_factors

  !> Factors of the stretch and of the dilatation of a bond by the law of a material; 1 for
  !> laws with a force of their own. `ratio`: |xi|/delta.
  pure subroutine law_factors(laws, material, ratio, gb, gd)
    type(law_item_type), intent(in) :: laws(:)
    integer, intent(in) :: material
    real(wp), intent(in) :: ratio
    real(wp), intent(out) :: gb, gd

    gb = 1.0_wp
    gd = 1.0_wp
    select type (law => laws(material)%law)
    class is (weighted_law_type)
      if (law%has_factors()) call law%bond_factors(ratio, gb, gd)
    class default  ! it says itself what it does with a factor
      continue
    end select
  end subroutine law_factors

  !> G of a bond along the unit vector `n` between points with factors `gk` and `gj`.
  pure real(wp) function bond_factor(n, gk, gj, axes) result(G)
    real(wp), intent(in) :: n(:)          !! (dim) unit vector along the bond [-]
    real(wp), intent(in) :: gk(:), gj(:)  !! (dim) D or S of the bond's two ends [-]
    real(wp), intent(in), optional :: axes(:, :)
      !! (dim, dim) directions of the factors in columns, absent: x, y, z
    real(wp) :: total, along
    integer :: c

    total = 0.0_wp
    do c = 1, size(n)
      along = n(c)
      if (present(axes)) along = dot_product(n, axes(:, c))
      total = total + (2*along/(gk(c) + gj(c)))**2
    end do
    G = 1.0_wp/sqrt(total)
  end function bond_factor

end module pd_family_surface
