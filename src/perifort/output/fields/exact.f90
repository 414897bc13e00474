!> The state of a body at one place and time as an answer in closed form knows it: what the fields
!> of the output take their exact values from.
module pd_output_fields_exact
  use pd_base_kinds, only: wp
  implicit none (type, external)
  private
  public :: exact_type

  !> What is not known stays 0.
  type :: exact_type
    integer :: dim = 1                     !! of the body
    logical :: known = .false.             !! the place and time belong to the answer: displacement
    logical :: knows_velocity = .false.
    logical :: knows_strain = .false.      !! dilatation and energy density
    logical :: knows_stress = .false.      !! gradient and stress
    logical :: in_equilibrium = .false.    !! in equilibrium and whole: no internal force, no damage
    real(wp) :: displacement(3) = 0.0_wp   !! [m]
    real(wp) :: velocity(3) = 0.0_wp       !! [m/s]
    real(wp) :: dilatation = 0.0_wp        !! [-]
    real(wp) :: energy_density = 0.0_wp    !! of the strain [J/m3]
    real(wp) :: gradient(3, 3) = 0.0_wp    !! of the displacements, du_i/dx_j [-]
    real(wp) :: stress(3, 3) = 0.0_wp      !! with zz in the plane [Pa]
  end type exact_type

end module pd_output_fields_exact
